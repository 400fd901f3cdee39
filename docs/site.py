"""Hooks of `mkdocs build`: the site has every page of the project at its path in the repository.

A link between two pages is therefore the same in a clone and on the site. Mermaid drawings become SVG, because the site
works without a network.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from benchmarks.figures.page import current_with_changes
from docs.drawing import as_svg, read_layers

ROOT = Path(__file__).resolve().parent.parent
_LOCAL = re.compile(r"\[([^\[\]]*)\]\((?!\w+:)([^)\s#]+)((?:#[^)\s]*)?)\)")
_DRAWING = re.compile(r"^```mermaid\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_SHOWN = {".md", ".jpg", ".png", ".svg", ".html", ".webp", ".ipynb"}


def on_files(files: Files, config: Any) -> Files:
    """The tracked pages and pictures of the project; what the theme brings stays."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    ours = [path for path in map(Path, listed.stdout.splitlines()) if path.suffix in _SHOWN]
    own = [path for path in ours if path.suffix == ".md" or path.parts[0] == "docs"]
    brought = [file for file in files if not Path(file.abs_src_path or "").is_relative_to(config["docs_dir"])]
    return Files(
        [
            *brought,
            *(
                File.generated(config, path.as_posix(), abs_src_path=str(ROOT / path))
                for path in own
                if (ROOT / path).is_file()
            ),
        ]
    )


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links to files that the site does not have, such as code, become their names; figures say what has changed since."""
    if page.file.src_uri == "docs/figures.md":
        markdown = current_with_changes()
    markdown = _DRAWING.sub(lambda _: as_svg(read_layers()), markdown)
    folder = Path(page.file.src_uri).parent

    def kept(match: re.Match[str]) -> str:
        name, target, anchor = match.groups()
        path = (ROOT / folder / target).resolve()
        if path.is_dir() and (path / "README.md").is_file():
            return f"[{name}]({target.rstrip('/')}/README.md{anchor})"
        there = path.is_relative_to(ROOT) and files.get_file_from_path(path.relative_to(ROOT).as_posix()) is not None
        return match[0] if there or not path.exists() else name

    return _LOCAL.sub(kept, markdown)
