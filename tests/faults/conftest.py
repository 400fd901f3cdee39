"""A very small block with one panorama, textured and published once; each test damages a copy."""

from __future__ import annotations

import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from tasks.engine.run import Run
from tasks.publish.task import publish_block
from tests.pipeline.painted_panoramas import CAMERAS, PICTURED, write_panoramas
from tests.pipeline.stages import BUILDINGS, STREETS, texture, write_block
from tests.sharing import alone

# An id longer than any file's name may be.
LONG = "long-" * 60


@pytest.fixture(scope="session")
def textured(common: Path) -> tuple[Path, Run]:
    """The block's file, and the run that published it: made by whichever process of the suite asks first, read by all."""
    folder, told = common / "small", common / "small.pickle"
    buildings = {(LONG if name == "e" else name): box for name, box in BUILDINGS.items()}
    streets = {(LONG if name == "3" else name): line for name, line in STREETS.items()}
    with alone(common, "small"):
        if not told.is_file():
            write_panoramas(folder / "block", {"a-1": CAMERAS["a-1"]})
            imagery = PICTURED["imagery"] | {"exemplars": {"path": "exemplars"}}
            block = write_block(folder / "block", buildings=buildings, streets=streets, imagery=imagery)
            made = texture(block, folder / "out").run
            publish_block.fn(made, block)
            told.write_bytes(pickle.dumps(made))
    return folder / "block" / "block.yaml", pickle.loads(told.read_bytes())


@pytest.fixture
def run(textured: tuple[Path, Run], tmp_path: Path) -> Run:
    """The same in a folder of its own."""
    shutil.copytree(textured[1].out, tmp_path / "out")
    return replace(textured[1], out=str(tmp_path / "out"), ingested=0.0)
