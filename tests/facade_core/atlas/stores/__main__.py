"""Make the store of the format of now: a small block, its history expired."""

from __future__ import annotations

import tarfile
import tempfile
from pathlib import Path

from facade_core.atlas.arrays import STORE_FORMAT
from facade_core.atlas.store import expire_snapshots, open_repository
from tests.facade_core.atlas.stores import BUILDINGS, STREETS
from tests.pipeline.stages import texture, write_block


def main() -> None:
    path = Path(__file__).with_name(f"format-{STORE_FORMAT}.tar.xz")
    with tempfile.TemporaryDirectory() as folder:
        made = texture(write_block(Path(folder) / "in", buildings=BUILDINGS, streets=STREETS), Path(folder) / "out")
        expire_snapshots(open_repository(made.run.store))
        with tarfile.open(path, "w:xz") as tar:
            tar.add(made.run.store, "store", filter=_nobodys)
    print(f"{path.name}: {path.stat().st_size} bytes")


def _nobodys(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    entry.uid = entry.gid = entry.mtime = 0
    entry.uname = entry.gname = ""
    return entry


if __name__ == "__main__":
    main()
