"""A block of two houses, which tests correct."""

from __future__ import annotations

from pathlib import Path

from tasks.engine.store.status import record_run_block_file
from tasks.publish.task import publish_block
from tests.pipeline.stages import Textured, texture, write_block, write_photo

# Those of the small block that stand about one street, and one of the others.
HOUSES = {"a": (4, 5, 12, 2.8, 7.0), "b": (24, -8, 12, 2.8, 9.0)}
STREET = {"1": [(0, 0), (45, 0)]}


def made(folder: Path) -> Textured:
    """The block textured and published."""
    block, out = folder / "in" / "block.yaml", folder / "out"
    done = texture(block, out)
    record_run_block_file(out, block)
    publish_block.fn(done.run, block)
    return done


def textured_houses(folder: Path) -> Path:
    """The houses of one street in a folder, one of them by a photo, textured and published."""
    write_photo(folder / "in", "a-0", 1)
    write_block(folder / "in", buildings=HOUSES, streets=STREET)
    made(folder)
    return folder
