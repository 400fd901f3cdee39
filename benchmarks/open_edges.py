"""Open edges of modelled buildings, as read and with the walls that they lack: `python -m benchmarks.open_edges --data DIR`.

Of Delfshaven, whose houses have no party walls: how many objects are open above their foot, and metres of edges that no other
surface continues. Edges of opposite directions on one line count as one where they overlap, however they are divided.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from pathlib import Path

import numpy as np
import shapely

from benchmarks.solid import DELFSHAVEN
from catalogs.block.reader import read_block
from facade_core.geometry.buildings.closing import (
    MAX_FOOT_M,
    concatenate_facets,
    missing_walls,
    open_edge_mask,
    triangle_areas,
)
from facade_core.geometry.buildings.facets import Facets, extract_shell_facets
from facade_core.geometry.charts import ChartKind

# Metres of open edges from which an object counts as open.
MIN_OPEN_M = 1.0
# Metres within which edges lie on one line.
LINE_GRID_M = 0.05


def open_metres(facets: Facets) -> float:
    """Sum the open edges above the foot of a shell, metres."""
    edges, is_open = open_edge_mask(facets)
    ends = facets.vertices[edges[is_open]]
    if not len(ends):
        return 0.0
    ends = ends[ends[..., 2].max(axis=1) > facets.vertices[facets.triangles][..., 2].min() + MAX_FOOT_M]
    step = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(step, axis=1)
    ends, step, length = ends[length > 0.01], step[length > 0.01], length[length > 0.01]
    direction = step / length[:, None]
    largest = np.take_along_axis(direction, np.abs(direction).argmax(axis=1)[:, None], axis=1)
    forward = largest[:, 0] > 0
    direction *= np.sign(largest)
    origin = facets.vertices[0]
    along = np.einsum("nkj,nj->nk", ends - origin, direction)
    foot = ends[:, 0] - origin - along[:, :1] * direction
    key = np.column_stack([np.round(direction * 20), np.round(foot / LINE_GRID_M)])
    total = 0.0
    for line in np.unique(key, axis=0):
        own = (key == line).all(axis=1)
        ways = [
            shapely.union_all([shapely.LineString([(a, 0), (b, 0)]) for a, b in along[own & way]])
            for way in (forward, ~forward)
        ]
        total += shapely.symmetric_difference(*ways).length
    return float(total)


def main() -> None:
    """Print the figures as one JSON object."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    default = Path(os.environ.get("STREETLOOM_DATA", "../shared/data"))
    parser.add_argument("--data", type=Path, default=default, help="the data folder")
    parser.add_argument("--every", type=int, default=1, help="of so many buildings one (1)")
    options = parser.parse_args()
    given = (options.data / DELFSHAVEN).resolve()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "block.yaml"
        path.write_text(
            json.dumps({"name": "model", "buildings": {"path": str(given)}, "texture": {"walls": "translate"}})
        )
        buildings = read_block(path).buildings[:: options.every]
    before, after, walls, added = [], [], 0.0, 0.0
    for building in buildings:
        assert building.shell is not None
        facets = extract_shell_facets(building.shell, building.footprint)
        before.append(open_metres(facets))
        walls += float(triangle_areas(facets)[facets.kind[facets.facet] == ChartKind.WALL].sum())
        if (missing := missing_walls(facets)) is not None:
            added += float(triangle_areas(missing).sum())
            facets = concatenate_facets(facets, missing)
        after.append(open_metres(facets))
    figures = {
        "objects": len(buildings),
        "open_objects": [sum(metres > MIN_OPEN_M for metres in one) for one in (before, after)],
        "open_metres": [round(sum(one)) for one in (before, after)],
        "wall_m2": round(walls),
        "added_wall_m2": round(added),
    }
    print(json.dumps({"benchmark": "open_edges"} | figures))


if __name__ == "__main__":
    main()
