"""Download of an example block: public data, painted exemplars and the block file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER, EXAMPLE_SOURCES, ExampleDataSource, download_example_data
from facade_core.core.errors import InputError
from tasks.engine.progress import begin_stage, report_progress
from tasks.examples.demo import copy_painted_exemplars

# Path of the exemplars in packaged block files, replaced by the painted library.
LIBRARY = "${STREETLOOM_DATA}/facades/ecp/images"


def fetch_block(
    name: str,
    folder: Path,
    sources: Mapping[str, ExampleDataSource] = EXAMPLE_SOURCES,
) -> tuple[Path, ExampleDataSource]:
    """Download an example block's public data and write its block file.

    Parameters
    ----------
    name : name of the block.
    folder : target folder.
    sources : sources of each block by name.

    Returns
    -------
    path : block file.
    source : its source.

    Raises
    ------
    InputError : no public data exist for this name, or a file is not available.
    """
    source = sources.get(name)
    if source is None:
        raise InputError(f"{name}: no block of this name has public data; there is {', '.join(sources)}")
    begin_stage("fetch", len(source.files))
    download_example_data(source, folder, lambda: report_progress("fetch", 1))
    copy_painted_exemplars(folder / "exemplars")
    text = (EXAMPLE_BLOCKS_FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    block = folder / f"{name}.yaml"
    block.write_text(text.replace(LIBRARY, "exemplars").replace("${STREETLOOM_DATA}/", ""), encoding="utf-8")
    return block, source
