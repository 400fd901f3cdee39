"""Paths for pyogrio, which takes `!`, `;` and addresses in a path for separators of archives and the like."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def gdal_read_path(path: Path) -> str:
    """Return a path that GDAL opens as this very file, and its siblings with it.

    `/vsisubfile/0_,` names a file from its first byte on; the rest of such a path is not parsed.
    """
    text = str(path.absolute())
    return text if _is_taken_as_written(text) else f"/vsisubfile/0_,{text}"


@contextmanager
def gdal_write_path(path: Path) -> Iterator[str]:
    """Yield a path by which GDAL writes this very file: through a link to its folder where it would be parsed."""
    text = str(path.absolute())
    if _is_taken_as_written(text):
        yield text
        return
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "folder"
        link.symlink_to(path.absolute().parent, target_is_directory=True)
        yield str(link / path.name)


def _is_taken_as_written(text: str) -> bool:
    from pyogrio.util import vsi_path

    return not text.startswith("/vsi") and bool(vsi_path(text) == text)
