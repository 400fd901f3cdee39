"""Cities of copies of one published block, for exports that only read them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path


def write_city(folder: Path, run: Path, names: Sequence[str], *, is_cut: bool = False) -> Path:
    """A city whose blocks all are the run: they share its store and its published files; returns its folder."""
    for name in names:
        block = folder / "blocks" / name
        if block.is_dir():
            continue
        block.mkdir(parents=True)
        for shared in ("store", "published"):
            (block / shared).symlink_to(run / shared, target_is_directory=True)
        shutil.copy(run / "current", block / "current")
        (block / "ended.json").write_text(json.dumps({"code": 0}))
    listed = dict.fromkeys(names, "digest")
    log = {"name": "twins", "digests": listed, "sources": {} if is_cut else listed}
    (folder / "city.json").write_text(json.dumps(log))
    return folder
