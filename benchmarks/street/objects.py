"""Objects of the street in block files: how many stand, whether any is in a wall, on a carriageway or off the ground; bytes.

python -m benchmarks.street.objects [BLOCK.yaml...] [--run OUT]

--run: bytes of block.glb of a finished run, and those of its objects and neighbours.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from catalogs.block.reader import read_block
from catalogs.published.folders import file_size
from facade_core.core.street_objects import OBJECT_KIND_NAMES, OBJECT_KINDS, PlacedObjects
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS
from facade_core.export.models.textured_mesh import mesh_y_up_frame
from facade_core.export.surroundings.gltf import SurroundingModel, encode_surroundings_glb
from facade_core.geometry.charts import ChartKind
from facade_core.geometry.ground.layers import join_carriageways, join_driven_lanes
from facade_core.geometry.ground.objects import place_objects, standing_areas
from facade_core.plan.ingest import BlockInputs, SceneLayout, build_scene_layout
from tasks.export.models import append_ground_index
from tasks.export.surroundings import build_surrounding_model
from tasks.publish.published_run import open_published_run


def measure(path: Path) -> dict[str, Any]:
    """Place the objects of a block and judge them by its footprints, carriageways and ground."""
    block = read_block(path)
    inputs = BlockInputs(block.buildings, block.streets, block.storey, block.ground, block.terrain)
    layout = build_scene_layout(inputs, block.texture)
    scene = layout.scene
    footprints = [building.footprint for building in (*block.buildings, *block.neighbours) if not building.raised]
    start = time.perf_counter()
    placed = place_objects(layout.ground, footprints, scene.charts, scene.mesh, layout.in_core)
    seconds = time.perf_counter() - start
    frame = mesh_y_up_frame(scene.mesh)
    sizes = {
        name: len(
            encode_surroundings_glb(SurroundingModel(placed, NO_SURROUNDINGS, frame, is_instanced=is_instanced), {}, "")
        )
        for name, is_instanced in (("instanced", True), ("nodes", False))
    }
    outline = shapely.box(*shapely.total_bounds([area for area in footprints]))
    stated = Counter(one.kind for one in block.ground.objects if one.is_stated and one.geometry.intersects(outline))
    return {
        "stated_within": dict(sorted(stated.items())),
        "placed": placed.counts(),
        "plausible": placed.plausible_counts(),
        **_count_faults(placed, layout, footprints),
        "glb_bytes": sizes,
        "seconds": round(seconds, 2),
    }


def _count_faults(placed: PlacedObjects, layout: SceneLayout, footprints: list[shapely.Geometry]) -> dict[str, float]:
    roads = [way for way in layout.ground.ways if way.kind == "road"]
    carriageway, lanes = join_carriageways(roads)[0], join_driven_lanes(roads)
    areas = np.array(standing_areas(placed), object)
    mesh, charts = layout.scene.mesh, layout.scene.charts
    corners = mesh.vertices[mesh.triangles[charts.kind[mesh.chart] == ChartKind.GROUND]]
    ground = shapely.STRtree(shapely.polygons(corners[..., :2]))
    feet = shapely.points(placed.position[:, :2])
    crowned = shapely.buffer(feet, placed.size[:, 0] / 2)
    crowns = np.isin(placed.kind, [0, 1])
    is_overhead = np.array([kind.is_overhead for kind in OBJECT_KINDS])[placed.kind]
    is_parked = ~placed.is_stated & (placed.kind == OBJECT_KIND_NAMES.index("parked_car"))
    likely, stated = areas[~placed.is_stated], areas[placed.is_stated & ~is_overhead]
    return {
        "in_a_wall": len(np.unique(shapely.STRtree(footprints).query(areas, predicate="intersects")[0])),
        "crowns_in_a_wall": len(
            np.unique(shapely.STRtree(footprints).query(crowned[crowns], predicate="intersects")[0])
        ),
        "on_a_carriageway": int(shapely.intersects(areas[~is_overhead & ~is_parked], carriageway).sum()),
        "parked_on_a_lane": int(shapely.intersects(areas[is_parked], lanes).sum()),
        "likely_in_another": len(np.unique(shapely.STRtree(stated).query(likely, predicate="intersects")[0]))
        + (len(shapely.STRtree(likely).query(likely, predicate="intersects")[0]) - len(likely)) // 2,
        "off_the_ground": int(len(placed) - len(np.unique(ground.query(feet, predicate="intersects")[0]))),
        "worst_terrain_gap_m": round(
            float(np.abs(layout.terrain.interpolate(placed.position[:, :2]) - placed.position[:, 2]).max(initial=0.0)),
            3,
        ),
    }


def measure_model(out: Path) -> dict[str, Any]:
    """Return the bytes of block.glb of a run, and how many times those that it has without objects and neighbours."""
    with open_published_run(out) as results:
        whole = file_size(results.snapshot.model) or 0
        shown = append_ground_index(results, results.select_buildings(()))
        around = build_surrounding_model(results, shown, mesh_y_up_frame(results.plan.scene.mesh))
        parts = {"objects": around.objects_alone, "neighbours": around.neighbours_alone}
        sizes = {name: len(encode_surroundings_glb(part, {}, "")) for name, part in parts.items()}
    times = whole / (whole - sum(sizes.values()))
    return {
        "block_glb_bytes": whole,
        **{f"{name}_bytes": size for name, size in sizes.items()},
        "times": round(times, 3),
    }


def main() -> None:
    """Print the figures of each block file, and those of the model of a run, as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("blocks", nargs="*", type=Path)
    parser.add_argument("--run", type=Path, metavar="OUT")
    options = parser.parse_args()
    figures = {path.stem: measure(path) for path in options.blocks}
    print(json.dumps(figures | ({"model": measure_model(options.run)} if options.run else {}), indent=1))


if __name__ == "__main__":
    main()
