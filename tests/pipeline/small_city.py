"""A city of three very small blocks, of which two are textured and published, and one waits."""

from __future__ import annotations

from pathlib import Path

import yaml

from catalogs.published.snapshot import current_snapshot
from tasks.city.city_log import BLOCKS_FOLDER, BlockResult, load_or_partition_city, write_block_result
from tasks.city.city_products import write_city_products
from tasks.city.source_digests import block_code_version
from tasks.engine.store.status import record_run_block_file
from tasks.publish.task import publish_block
from tests.pipeline.stages import texture, write_block

# A house on either side of where the city is cut, one beyond, and a street past all of them.
HOUSES = {"a": (4, 5, 12, 6, 7.0), "b": (74, 5, 12, 6, 9.0), "c": (160, 5, 12, 6, 9.0)}
STREETS = {"1": [(0, 0), (45, 0), (90, 0), (180, 0)]}


def write_city(folder: Path) -> Path:
    """The city's file in a folder."""
    block = write_block(folder, buildings=HOUSES, streets=STREETS)
    keys = yaml.safe_load(block.read_text()) | {"name": "town", "cut": {"metres": 70}}
    (folder / "town.yaml").write_text(yaml.safe_dump(keys))
    return folder / "town.yaml"


def textured_city(folder: Path) -> tuple[Path, list[str]]:
    """The city's folder and the names of its blocks; the last of them waits."""
    out = folder / "out"
    log, files = load_or_partition_city(write_city(folder / "in"), out)
    names = list(log.blocks)
    for name in names[:-1]:
        block = out / BLOCKS_FOLDER / name
        done = texture(files[name], block)
        record_run_block_file(block, files[name])
        publish_block.fn(done.run, files[name])
        result = BlockResult(
            0,
            log.digests[name],
            block_code_version(),
            current_snapshot(block).id,
        )
        write_block_result(out, name, result)
    write_city_products(out, names, print)
    return out, names
