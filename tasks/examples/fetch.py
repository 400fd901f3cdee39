"""Fetch an example block: its public data, painted exemplars, and a block file that names both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER, EXAMPLE_SOURCES, ExampleSource, download_source
from facade_core.core.errors import InputError
from tasks.engine.progress import begin_stage, report_progress
from tasks.examples.demo import EXEMPLARS, paint_exemplars

# Where the packaged block files look for the exemplars that a fetched block has painted.
LIBRARY = "${STREETLOOM_DATA}/facades/ecp/images"


def fetch_block(
    name: str,
    folder: Path,
    sources: Mapping[str, ExampleSource] = EXAMPLE_SOURCES,
    paint: Callable[[Path], None] = paint_exemplars,
) -> tuple[Path, ExampleSource]:
    """Make `folder`/NAME.yaml with everything that it names; what is there already stays. Returns it and its source.

    Args:
        sources: what each block is made from, by its name.
        paint: paints a style library into a folder.

    Raises InputError for a name without public data, and where a file cannot be had.
    """
    source = sources.get(name)
    if source is None:
        raise InputError(f"{name}: no block of this name has public data; there is {', '.join(sources)}")
    begin_stage("fetch", len(source.files))
    download_source(source, folder, lambda: report_progress("fetch", 1))
    exemplars = folder / "exemplars"
    if not (exemplars.is_dir() and len(list(exemplars.iterdir())) == EXEMPLARS):
        paint(exemplars)
    text = (EXAMPLE_BLOCKS_FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    block = folder / f"{name}.yaml"
    block.write_text(text.replace(LIBRARY, "exemplars").replace("${STREETLOOM_DATA}/", ""), encoding="utf-8")
    return block, source
