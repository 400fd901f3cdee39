"""Buildings and ground around a block, which views and models show in plain colours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from facade_core.core.arrays import Float64Array
from facade_core.core.errors import GeometryError
from facade_core.core.name_hash import hash_name
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS, SurroundingMaterial, SurroundingMesh
from facade_core.core.types import SURFACES, Building, MappedGround
from facade_core.geometry.block_surfaces import add_building_charts
from facade_core.geometry.charts import ChartBuilder, ChartKind, Charts, Mesh, SurfaceTarget
from facade_core.geometry.ground.ground_charts import add_ground_charts
from facade_core.geometry.ground.layers import (
    FIRST_AREA_LAYER,
    FIRST_PATH_LAYER,
    PAVEMENT_LAYER,
    ROAD_LAYER,
    ground_layers,
    join_carriageways,
)
from facade_core.geometry.ground.terrain import Terrain
from facade_core.plan.settings import SURROUNDINGS

NO_TINT = (0, 0, 0)


@dataclass
class _Pieces:
    """Surfaces so far, with the seed, tints of walls and roofs, and material of the ground of each chart."""

    charts: ChartBuilder = field(default_factory=ChartBuilder)
    seed: list[int] = field(default_factory=list)
    tints: list[tuple[tuple[int, int, int], tuple[int, int, int]]] = field(default_factory=list)
    surface: list[int] = field(default_factory=list)

    def note_new(self, seed: int, wall: tuple[int, int, int], roof: tuple[int, int, int], surface: int) -> None:
        """Note what the charts are that were added since the last call."""
        count = len(self.charts) - len(self.seed)
        self.seed += [seed] * count
        self.tints += [(wall, roof)] * count
        self.surface += [surface] * count


def build_surroundings(
    neighbours: Sequence[Building],
    ground: MappedGround,
    block: tuple[Charts, Mesh],
    footprints: Sequence[BaseGeometry],
    terrain: Terrain,
) -> SurroundingMesh:
    """Build the mesh of the buildings and the ground around a block, to `SURROUNDINGS.distance_m` from it.

    Parameters
    ----------
    neighbours : buildings around the block.
    ground : mapped ground.
    block : charts and mesh of the block.
    footprints : outlines of the block's buildings.
    terrain : ground heights.
    """
    if not neighbours:
        return NO_SURROUNDINGS
    pieces = _Pieces()
    for building in neighbours:
        # details of assumed roofs, such as chimneys, are left to the block's own buildings
        roof = building.roof and replace(building.roof, confidence=1.0)
        with suppress(GeometryError):
            target = SurfaceTarget(pieces.charts, 0, np.inf, SURROUNDINGS.ground_grid_m)
            add_building_charts(target, replace(building, roof=roof), terrain)
        finish = building.finish
        pieces.note_new(hash_name(building.id), finish.wall_colour or NO_TINT, finish.roof_colour or NO_TINT, 0)
    covered = _covered_ground(*block, footprints)
    around = covered.convex_hull.buffer(SURROUNDINGS.distance_m, join_style="mitre", mitre_limit=1.5)
    free = around.difference(shapely.union_all([covered, *(one.footprint for one in neighbours if not one.raised)]))
    for surface, part in _split_by_surface(ground, free):
        polygons = [one for one in shapely.get_parts(part) if one.geom_type == "Polygon" and one.area > 1.0]
        add_ground_charts(pieces.charts, polygons, terrain, SURROUNDINGS.ground_grid_m)
        pieces.note_new(0, NO_TINT, NO_TINT, SURFACES.index(surface))
    return _to_mesh(pieces)


def _covered_ground(charts: Charts, mesh: Mesh, footprints: Sequence[BaseGeometry]) -> BaseGeometry:
    triangles = mesh.triangles[charts.kind[mesh.chart] == ChartKind.GROUND]
    parts = shapely.polygons(mesh.vertices[triangles][..., :2])
    return shapely.union_all(shapely.buffer([*parts, *footprints], SURROUNDINGS.seam_m, join_style="mitre")).buffer(
        -SURROUNDINGS.seam_m, join_style="mitre"
    )


def _split_by_surface(ground: MappedGround, free: BaseGeometry) -> Iterator[tuple[str, BaseGeometry]]:
    """Yield the free ground by surface; what no map states is paved."""
    carriageway, _ = join_carriageways([way for way in ground.ways if way.kind == "road"])
    for layer, shape in sorted(ground_layers(ground.areas, ground.ways, carriageway).items(), reverse=True):
        shown = free.intersection(shape.simplify(SURROUNDINGS.tolerance_m))
        if not shown.is_empty:
            free = free.difference(shown)
            yield _surface_of_layer(layer), shown
    yield "slabs", free


def _surface_of_layer(layer: int) -> str:
    if layer in (PAVEMENT_LAYER, ROAD_LAYER):
        return "asphalt" if layer == ROAD_LAYER else "slabs"
    return SURFACES[layer - (FIRST_PATH_LAYER if layer >= FIRST_PATH_LAYER else FIRST_AREA_LAYER)]


def _to_mesh(pieces: _Pieces) -> SurroundingMesh:
    charts, mesh = pieces.charts.build()
    kind, (wall, roof) = charts.kind, np.array(pieces.tints, np.uint8).reshape(-1, 2, 3).swapaxes(0, 1)
    is_ground = kind == ChartKind.GROUND
    is_wall = kind == ChartKind.WALL
    material = np.where(
        is_ground,
        np.array(pieces.surface, np.uint8),
        np.where(is_wall, SurroundingMaterial.WALL, SurroundingMaterial.ROOF),
    ).astype(np.uint8)
    of = mesh.vertex_chart
    normal: Float64Array = charts.normals()[of]
    return SurroundingMesh(
        mesh.vertices,
        normal,
        material[of],
        np.where(is_wall[:, None], wall, roof)[of],
        np.array(pieces.seed, np.int64)[of],
        mesh.triangles,
    )
