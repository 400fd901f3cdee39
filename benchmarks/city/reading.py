"""What cutting a city costs for each block, and what a block's own reading costs, by how many blocks there are: tiled copies
of a town, a tile a block, in seconds of the processor.

python -m benchmarks.city.reading [--sides 4 7 12 21]
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import yaml

from benchmarks.timing import figures
from catalogs.block.reader import read_block
from tasks.city.blocks import partition_city_file
from tests.pipeline.stages import write_block

TILE_M = 100
# South-western corner in its tile, width, depth and height of each house.
HOUSES = ((8, 56, 14, 9, 7.0), (22, 56, 12, 9, 10.0), (55, 56, 16, 9, 9.0), (10, 34, 18, 9, 12.0), (60, 34, 12, 9, 7.0))


def write_town(
    folder: Path, columns: int, rows: int, *, metres: int = TILE_M, texels: float = 3.0, panorama: int = 128
) -> Path:
    """A city file of so many tiles, of five houses each, streets along all of them, cut into blocks of so many metres."""
    houses = {
        f"h{column}-{row}-{number}": (TILE_M * column + x, TILE_M * row + y, *size)
        for column in range(columns)
        for row in range(rows)
        for number, (x, y, *size) in enumerate(HOUSES)
    }
    along = {f"e{row}": [(TILE_M * column, TILE_M * row + 50) for column in range(columns + 1)] for row in range(rows)}
    across = {
        f"n{column}": [(TILE_M * column, y) for y in (10, *range(50, TILE_M * rows, TILE_M), TILE_M * rows - 10)]
        for column in range(columns)
    }
    texture = {"texels_per_metre": texels, "panorama_width": panorama}
    block = write_block(folder, buildings=houses, streets=along | across, texture=texture)
    keys = yaml.safe_load(block.read_text()) | {"name": "town", "cut": {"metres": metres}}
    (folder / "town.yaml").write_text(yaml.safe_dump(keys))
    return folder / "town.yaml"


def measure(sides: tuple[int, ...]) -> list[dict[str, Any]]:
    """By how many tiles a side the town has."""
    found = []
    for side in sides:
        with tempfile.TemporaryDirectory() as name:
            town = write_town(Path(name), side, side)
            begun = time.process_time()
            blocks = partition_city_file(town, Path(name) / "out").blocks
            cut = time.process_time() - begun
            begun = time.process_time()
            read_block(blocks[len(blocks) // 2].file)
            read = time.process_time() - begun
        found.append(
            {
                "blocks": len(blocks),
                "cut_ms_a_block": figures(1000 * cut / len(blocks)),
                "read_ms": figures(1000 * read),
            }
        )
    return found


def main() -> None:
    """Print what was measured as JSON."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--sides", type=int, nargs="+", default=[4, 7, 12, 21], help="tiles a side [4 7 12 21]")
    print(json.dumps(measure(tuple(parser.parse_args().sides)), indent=1))


if __name__ == "__main__":
    main()
