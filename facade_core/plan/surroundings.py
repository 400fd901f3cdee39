"""Buildings and ground around a block, which views and models show in plain colours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

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
from facade_core.plan.surrounding_windows import build_windows

NO_TINT = (0, 0, 0)
# In place of the row of a building.
GROUND = -1


@dataclass
class _Pieces:
    """Surfaces so far, with the row of the building and the material of the ground of each chart."""

    charts: ChartBuilder = field(default_factory=ChartBuilder)
    owner: list[int] = field(default_factory=list)
    surface: list[int] = field(default_factory=list)

    def note_new(self, owner: int, surface: int = 0) -> None:
        """Note what the charts are that were added since the last call."""
        count = len(self.charts) - len(self.owner)
        self.owner += [owner] * count
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
    for owner, building in enumerate(neighbours):
        # details of assumed roofs, such as chimneys, are left to the block's own buildings
        roof = building.roof and replace(building.roof, confidence=1.0)
        with suppress(GeometryError):
            target = SurfaceTarget(pieces.charts, 0, np.inf, SURROUNDINGS.ground_grid_m)
            add_building_charts(target, replace(building, roof=roof), terrain)
        pieces.note_new(owner)
    covered = _covered_ground(*block, footprints)
    around = covered.convex_hull.buffer(SURROUNDINGS.distance_m, join_style="mitre", mitre_limit=1.5)
    free = around.difference(shapely.union_all([covered, *(one.footprint for one in neighbours if not one.raised)]))
    for surface, part in _split_by_surface(ground, free):
        polygons = [one for one in shapely.get_parts(part) if one.geom_type == "Polygon" and one.area > 1.0]
        add_ground_charts(pieces.charts, polygons, terrain, SURROUNDINGS.ground_grid_m)
        pieces.note_new(GROUND, SURFACES.index(surface))
    return _to_mesh(pieces, neighbours, terrain)


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


def _to_mesh(pieces: _Pieces, neighbours: Sequence[Building], terrain: Terrain) -> SurroundingMesh:
    charts, mesh = pieces.charts.build()
    owner, is_wall = np.array(pieces.owner, np.int64), charts.kind == ChartKind.WALL
    material = np.where(is_wall, SurroundingMaterial.WALL, SurroundingMaterial.ROOF)
    material = np.where(owner == GROUND, np.array(pieces.surface, np.uint8), material).astype(np.uint8)
    # the last row is that of the ground
    seed = np.array([*(hash_name(one.id) for one in neighbours), 0], np.int64)
    tints = [[one.finish.wall_colour or NO_TINT, one.finish.roof_colour or NO_TINT] for one in neighbours]
    tint = np.array([*tints, [NO_TINT, NO_TINT]], np.uint8)[owner, np.where(is_wall, 0, 1)]
    normal, of = charts.normals(), mesh.vertex_chart
    windows = build_windows(neighbours, owner, charts, mesh, terrain)
    walls = SurroundingMesh(mesh.vertices, normal[of], material[of], tint[of], seed[owner][of], mesh.triangles)
    joined = {key: np.concatenate([part, getattr(windows, key)]) for key, part in vars(walls).items()}
    joined["triangles"][len(walls) :] += np.int32(len(walls.vertices))
    return SurroundingMesh(**joined)
