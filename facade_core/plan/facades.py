"""Selection of the walls of a block that are facades: walls that a street sees, and others with a free part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.grouping import RowsByValue, group_rows
from facade_core.core.name_hash import hash_name
from facade_core.core.ties import first_maximum
from facade_core.core.types import Building, Street
from facade_core.geometry.charts import ChartKind, Charts
from facade_core.geometry.raycast import MISS
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.geometry.streets import Viewpoint
from facade_core.geometry.walls import WallRole, group_walls_into_runs
from facade_core.plan.settings import PLANNED_FACADES


@dataclass(frozen=True)
class Facades:
    """Facades of a block as columns.

    Attributes
    ----------
    id : name that is stable as long as the building's footprint is.
    chart, building : (n,) indices.
    street : (n,) index of the street; the nearest where none sees the wall.
    role : (n,) `facade_core.geometry.walls.WallRole`.
    width, height : (n,) metres.
    floors : (n,) number of floors, by the map or the height, ground floor included.
    seen : (n,) share of the wall that its street sees.
    run : (n,) first facade of the run that is laid out as one, itself for most.
    along : (n,) metres from the start of the run.
    foot : (n,) metres over the foot of most of the building's walls.
    eaves : (n,) metres from there to where most of them end.
    storeys : (n,) number of floors up to the eaves.
    raised : (n,) True where the building begins above the ground, or the wall on a roof.
    house : (n,) 32-bit hash of the whole building; all its parts share a style.
    roofed : (n,) True where the model states the roof of its building, or gives it a pitch.
    """

    id: tuple[str, ...]
    chart: Int32Array
    street: Int32Array
    building: Int32Array
    role: UInt8Array
    width: Float64Array
    height: Float64Array
    floors: Int32Array
    seen: Float64Array
    run: Int32Array
    along: Float64Array
    foot: Float64Array
    eaves: Float64Array
    storeys: Int32Array
    raised: BoolArray
    house: Int64Array
    roofed: BoolArray

    def __len__(self) -> int:
        return len(self.id)

    def run_members(self, facade: int) -> Int64Array:
        """Return the facades (k,) of a facade's run from left to right, itself included."""
        own = self._by_run.rows_with(int(self.run[facade]))
        return own[np.argsort(self.along[own], kind="stable")]

    def building_facades(self, facade: int) -> Int64Array:
        """Return the facades (k,) of a facade's building, ascending."""
        return self._by_building.rows_with(int(self.building[facade]))

    @cached_property
    def _by_building(self) -> RowsByValue:
        return RowsByValue(self.building)

    @cached_property
    def _by_run(self) -> RowsByValue:
        return RowsByValue(self.run)


def find_facades(
    scene: Scene,
    buildings: Sequence[Building],
    viewpoints: Sequence[Viewpoint],
    seen: Sequence[Int32Array],
    floor_height: float,
    free_share: Float64Array,
    streets: Sequence[Street] = (),
) -> Facades:
    """Find the facades of a block: walls that a street sees, and with `streets` all others with a free part.

    Parameters
    ----------
    scene : geometry of the block.
    buildings : all buildings, in the order of `Charts.building`.
    viewpoints : the viewpoints.
    seen : charts in the panorama of each viewpoint.
    floor_height : floor height in metres where levels are not tagged.
    free_share : (charts,) share of each chart without a neighbour against it.
    streets : all streets; empty restricts the result to walls that a street sees.
    """
    charts = scene.charts
    large = _is_large_wall(scene) & _is_upright_wall(scene, buildings)
    free = free_wall_mask(scene, buildings, free_share) if streets else np.zeros(len(charts), bool)
    runs = group_walls_into_runs(charts, np.flatnonzero(large | free))
    run, wide, along = np.arange(len(charts)), charts.size[:, 0].copy(), np.zeros(len(charts))
    for one in runs:
        ends = np.concatenate([[0.0], np.cumsum(charts.size[one, 0])])
        run[one], wide[one], along[one] = one[0], ends[-1], ends[:-1]
    best, street = _best_visibility(scene, large | free, viewpoints, seen)
    shown = best >= PLANNED_FACADES.min_seen_share
    for one in runs:  # all facets of a round wall share one role
        shown[one] = shown[one].any() if streets else shown[one]
    role = np.where(
        shown, np.where(wide >= PLANNED_FACADES.min_facade_width_m, WallRole.STREET, WallRole.SIDE), WallRole.BACK
    ).astype(np.uint8)
    chart = np.flatnonzero((large & (role == WallRole.STREET)) | free)
    if streets:
        street[chart] = _nearest_streets(charts, chart, street[chart], best[chart], streets)
    building = charts.building[chart]
    wall = _wall_numbers(charts)[chart]
    width, height = charts.size[chart].T
    foot, eaves = _foot_and_eaves(charts, chart)
    levels = [buildings[b].levels for b in building]
    storeys = count_facade_floors(levels, eaves, floor_height)
    _, first, of = np.unique(run[chart], return_index=True, return_inverse=True)
    return Facades(
        id=tuple(f"{buildings[b].id}-{w}" for b, w in zip(building, wall, strict=True)),
        chart=chart.astype(np.int32),
        street=street[chart],
        building=building.astype(np.int32),
        role=role[chart],
        width=width,
        height=height,
        floors=np.where(
            np.abs(height - eaves) < FACADE_WALLS.level_tolerance_m,
            storeys,
            np.maximum(1, np.round(height * storeys / eaves)),
        ).astype(np.int32),
        seen=best[chart],
        run=first[of].astype(np.int32),
        along=along[chart],
        foot=foot,
        eaves=eaves,
        storeys=storeys,
        raised=np.array([buildings[b].raised > 0 for b in building], bool) | _begins_above_ground(scene, chart, foot),
        house=np.array([hash_name(buildings[b].whole_id) for b in building], np.int64),
        roofed=np.array([_has_modelled_roof(buildings[b]) for b in building], bool),
    )


def free_wall_mask(scene: Scene, buildings: Sequence[Building], free_share: Float64Array) -> BoolArray:
    """Return the walls at least a floor high with a free part, which are facades whether a street sees them or not.

    Parameters
    ----------
    scene, buildings, free_share : as of `find_facades`.

    Returns
    -------
    (charts,) bool.
    """
    return (
        _is_tall_wall(scene.charts)
        & (free_share >= PLANNED_FACADES.min_free_share)
        & _is_upright_wall(scene, buildings)
    )


def _is_upright_wall(scene: Scene, buildings: Sequence[Building]) -> BoolArray:
    """Return the charts that are neither gables nor inside passages, (charts,)."""
    return ~_is_gable(scene, buildings) & ~_is_inside_passage(scene.charts, buildings)


def _is_large_wall(scene: Scene) -> BoolArray:
    """Return the walls that are large enough to be parsed, (charts,)."""
    charts = scene.charts
    large = (
        (charts.kind == ChartKind.WALL)
        & (charts.size[:, 0] >= PLANNED_FACADES.min_facade_width_m)
        & (charts.size[:, 1] >= PLANNED_FACADES.min_facade_height_m)
    )
    is_large_wall: BoolArray = large & (
        charts.texels(scene.placement.texels_per_metre).min(axis=1) >= PLANNED_FACADES.min_facade_texels
    )
    return is_large_wall


def _is_tall_wall(charts: Charts) -> BoolArray:
    """Return the walls at least a floor high, narrow ones and the facets of round ones included, (charts,)."""
    tall, width = (
        (charts.kind == ChartKind.WALL) & (charts.size[:, 1] >= PLANNED_FACADES.min_facade_height_m),
        charts.size[:, 0],
    )
    is_wide = width >= FACADE_WALLS.min_wall_m
    facets = np.flatnonzero(
        tall & (width >= FACADE_WALLS.min_unrolled_facet_m) & (width < FACADE_WALLS.max_unrolled_facet_m)
    )
    for run in group_walls_into_runs(charts, facets) if not is_wide[facets].all() else ():
        is_wide[run] |= width[run].sum() >= PLANNED_FACADES.min_facade_width_m
    is_tall_wall: BoolArray = tall & is_wide
    return is_tall_wall


def _nearest_streets(
    charts: Charts, chart: Int64Array, street: Int32Array, seen: Float64Array, streets: Sequence[Street]
) -> Int32Array:
    """Return the streets (k,) of charts: the nearest where none sees them."""
    middle = shapely.points(charts.points_at_shares(chart, np.array([[0.5, 0.5]]))[:, 0, :2])
    nearest = shapely.STRtree([one.line for one in streets]).nearest(middle)
    return np.where(seen > 0, street, nearest).astype(np.int32)


def _foot_and_eaves(charts: Charts, chart: Int64Array) -> tuple[Float64Array, Float64Array]:
    """Return the foot of walls (k,) over the prevailing foot of their building, and the prevailing eaves over that, metres."""
    foot = charts.points_at_shares(chart, np.array([[0.0, 1.0]]))[:, 0, 2]
    top, width = charts.origin[chart, 2], charts.size[chart, 0]
    over, eaves = np.zeros(len(chart)), charts.size[chart, 1].copy()
    for own in group_rows(charts.building[chart]).values():
        base, end = (_prevailing_level(level[own], width[own]) for level in (foot, top))
        if end - base >= PLANNED_FACADES.min_facade_height_m:
            over[own], eaves[own] = foot[own] - base, end - base
    return np.where(np.abs(over) < FACADE_WALLS.level_tolerance_m, 0.0, over), eaves


def _begins_above_ground(scene: Scene, chart: Int64Array, foot: Float64Array) -> BoolArray:
    """Return the walls (k,) above a roof, or a floor above the prevailing foot and without ground below."""
    charts = scene.charts
    feet = charts.points_at_shares(chart, np.array([[share, 1.0] for share in PLANNED_FACADES.foot_probe_shares]))
    above = (
        feet
        + PLANNED_FACADES.foot_probe_distance_m * charts.normals()[chart][:, None]
        + [0.0, 0.0, PLANNED_FACADES.foot_probe_height_m]
    )
    distance, met = scene.caster.cast(above, np.broadcast_to([0.0, 0.0, -1.0], above.shape))
    is_near, kind = (
        (met != MISS) & (distance < PLANNED_FACADES.foot_probe_height_m + PLANNED_FACADES.max_ground_drop_m),
        charts.kind[met],
    )
    roofs, grounds = ((is_near & (kind == one)).mean(axis=1) > 0.5 for one in (ChartKind.ROOF, ChartKind.GROUND))
    is_raised: BoolArray = roofs | ((foot > PLANNED_FACADES.min_facade_height_m) & ~grounds)
    return is_raised


def _has_modelled_roof(building: Building) -> bool:
    """Return whether a building has a roof of its own: a modelled, a stated or a pitched one, not an assumed flat one."""
    if building.shell is not None or building.roof is None:
        return building.shell is not None
    return building.roof.height > 0 or building.roof.confidence == 1.0


def _prevailing_level(level: Float64Array, width: Float64Array) -> float:
    """Return the level with most wall width within LEVEL_TOLERANCE_M."""
    near = np.abs(level[:, None] - level) < FACADE_WALLS.level_tolerance_m
    return float(level[first_maximum((near * width).sum(axis=1))])


def _is_gable(scene: Scene, buildings: Sequence[Building]) -> BoolArray:
    """Return the charts above the walls of buildings without a model, whose walls are rectangles: (charts,)."""
    charts, mesh = scene.charts, scene.mesh
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    area = np.bincount(mesh.chart, 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1), len(charts))
    built = np.array([building.shell is None for building in buildings], bool)[charts.building] & (charts.building >= 0)
    is_gable: BoolArray = built & (area < 0.99 * charts.size.prod(axis=1))
    for chart in np.flatnonzero(is_gable).tolist():  # a wall with a passage is no rectangle, but has its upper corners
        if buildings[charts.building[chart]].passages:
            corners = mesh.vertices[np.unique(mesh.triangles[mesh.chart_triangles(chart)])]
            upper = charts.points_at_shares(np.array([chart]), np.array([[0.0, 0.0], [1.0, 0.0]]))[0]
            apart = np.linalg.norm(corners[:, None] - upper, axis=-1).min(axis=0)
            is_gable[chart] = bool((apart > FACADE_WALLS.corner_tolerance_m).any())
    return is_gable


def _is_inside_passage(charts: Charts, buildings: Sequence[Building]) -> BoolArray:
    """Return the walls inside the passages of buildings, which are no facades: (charts,)."""
    is_inside = np.zeros(len(charts), bool)
    opened = np.array([bool(building.passages) for building in buildings], bool)
    walls = np.flatnonzero((charts.kind == ChartKind.WALL) & (charts.building >= 0))
    for chart in walls[opened[charts.building[walls]]].tolist():
        middle = shapely.Point(charts.points_at_shares(np.array([chart]), np.array([[0.5, 0.5]]))[0, 0, :2])
        footprint = buildings[charts.building[chart]].footprint
        is_inside[chart] = (
            footprint.contains(middle) and footprint.boundary.distance(middle) > PLANNED_FACADES.off_outline_m
        )
    return is_inside


def _best_visibility(
    scene: Scene, candidate: BoolArray, cameras: Sequence[Viewpoint], seen: Sequence[Int32Array]
) -> tuple[Float64Array, Int32Array]:
    """Return the largest share of each chart that one street sees, (charts,), and the first such street, 0 without.

    Every viewpoint looks at a grid of points on each candidate in its panorama.
    """
    charts = scene.charts
    across, down = ((np.arange(n) + 0.5) / n for n in PLANNED_FACADES.samples_per_axis)
    grid = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    best, best_street = np.zeros(len(charts)), np.zeros(len(charts), np.int32)
    in_order = sorted(zip(cameras, seen, strict=True), key=lambda one: one[0].street)
    for street, looks in groupby(in_order, key=lambda one: one[0].street):
        visible: dict[int, BoolArray] = {}
        for camera, row in looks:
            walls = row[candidate[row]]
            if len(walls) == 0:
                continue
            ray = charts.points_at_shares(walls, grid) - camera.position
            distance, chart = scene.caster.cast(camera.position, ray)
            reached = (distance > 1 - 1e-3) | (chart == walls[:, None])
            reached &= np.linalg.norm(ray, axis=-1) <= scene.visibility_range
            for wall, points in zip(walls.tolist(), reached, strict=True):
                visible[wall] = visible[wall] | points if wall in visible else points
        if not visible:
            continue
        shown, share = np.array(list(visible)), np.array(list(visible.values())).mean(axis=1)
        better = share > best[shown]
        best[shown[better]], best_street[shown[better]] = share[better], street
    return best, best_street


def _wall_numbers(charts: Charts) -> Int64Array:
    """Return the number of each wall among those of its building, (charts,)."""
    number = np.zeros(len(charts), np.int64)
    walls = np.flatnonzero(charts.kind == ChartKind.WALL)
    walls = walls[np.argsort(charts.building[walls], kind="stable")]
    owners = charts.building[walls]
    number[walls] = np.arange(len(walls)) - np.searchsorted(owners, owners)
    return number


def count_facade_floors(levels: Sequence[int | None], height: Float64Array, floor_height: float) -> Int32Array:
    """Count the floors of facades: tagged levels, else by the floor height, limited to what the height allows.

    Parameters
    ----------
    levels : tagged levels, None where unknown.
    height : (n,) metres.
    floor_height : floor height in metres.

    Returns
    -------
    (n,).
    """
    tagged = np.array([count or 0 for count in levels], np.int64)
    floors = np.where(tagged > 0, tagged, np.maximum(1, np.round(height / floor_height))).astype(np.int32)
    low, high = (
        np.where(tagged > 0, *limits)
        for limits in zip(PLANNED_FACADES.tagged_floor_height_m, FACADE_WALLS.floor_height_m, strict=True)
    )
    most = np.maximum(1, np.floor(height / low))
    return np.clip(floors, np.minimum(np.ceil(height / high), most), most).astype(np.int32)
