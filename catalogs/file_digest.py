"""Digests of input files by content."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from facade_core.core.regular_files import open_regular


def file_digest(path: Path) -> str:
    """Return the sha256 of a file, cached until its size or modification time changes."""
    state = path.stat()
    return _content_digest(path, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=65536)
def _content_digest(path: Path, size: int, modified: int) -> str:
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
