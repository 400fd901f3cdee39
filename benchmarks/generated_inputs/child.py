"""Process that reads the block files that its input names, one a line, and answers each with one line of JSON."""

from __future__ import annotations

import json
import sys
import traceback
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from catalogs.block.settings import replace_settings
from facade_core.core.types import Building


def main() -> None:
    from facade_core.core.errors import InputError

    for line in sys.stdin:
        asked = json.loads(line)
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            try:
                answer = read_facts(Path(asked["path"]), with_plan=asked["plan"])
            except InputError as error:
                answer = {"result": "refused", "message": str(error)}
            except Exception:
                answer = {"result": "traceback", "message": traceback.format_exc()}
        shown = [
            f"{one.category.__name__}: {one.message}" for one in warned if issubclass(one.category, RuntimeWarning)
        ]
        print(json.dumps(answer | {"warnings": shown}), flush=True)


def read_facts(path: Path, *, with_plan: bool = False) -> dict[str, Any]:
    """Return what a block holds, as values of JSON; with_plan: plan it too."""
    from catalogs.block.reader import read_block

    block = read_block(path)
    facts: dict[str, Any] = {
        "result": "read",
        "crs": block.crs.to_wkt(),
        "notes": list(block.notes),
        "faults": [f"{fault.id}: {fault.reason}" for fault in block.faults],
        "buildings": [
            {
                "id": one.id,
                "name": one.name,
                "height": _stated_height(one),
                "source": one.height_source,
                "levels": one.levels,
                "base": one.base,
                "outline": shapely.to_wkt(one.footprint, rounding_precision=4),
            }
            for one in block.buildings
        ],
        "streets": [[one.name, shapely.to_wkt(one.line, rounding_precision=4)] for one in block.streets],
        "panoramas": {one.id: [one.pose.x, one.pose.y, one.pose.z, one.pose.heading] for one in block.panoramas},
        "photos": sorted(block.photos),
        "uv": None,
    }
    shells = [one.shell for one in block.buildings if one.shell is not None]
    if uv := [shell.uv[shell.texture >= 0].reshape(-1, 2) for shell in shells if (shell.texture >= 0).any()]:
        found = np.concatenate(uv)
        facts["uv"] = [float(value) for value in (*found.min(axis=0), *found.max(axis=0))]
    if with_plan:
        from tasks.stages.ingest.planning import make_plan

        make_plan(replace(block, settings=replace_settings(block.settings, texels_per_metre=8.0)))
    return facts


def _stated_height(building: Building) -> float:
    """Return the height as sources state it: to the ridge; levels end at the eaves."""
    to_eaves = building.roof is None or building.shell is not None or building.height_source == "levels"
    return building.height if to_eaves or building.roof is None else building.height + building.roof.height


if __name__ == "__main__":
    main()
