"""What of a block is its own where it is a part of a city: the rest is seen, and not textured."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import shapely

from facade_core.core.types import Building, Street
from facade_core.geometry.charts import Charts
from facade_core.geometry.streets import Viewpoint
from facade_core.geometry.texel_density import HALF_DENSITY_M
from facade_core.plan.facades import Facades


@dataclass(frozen=True)
class CoreRegion:
    """The ids of a block's own buildings and streets; the others are context."""

    buildings: Collection[str]
    streets: Collection[str]


def core_charts(
    charts: Charts, buildings: Sequence[Building], streets: Sequence[Street], own: CoreRegion
) -> np.ndarray:
    """Which charts are a block's own, (n,) bool: those of its buildings, and the ground to which one of them, or one of its
    streets, is nearest, buildings before streets and those first by their ids."""
    mine = np.array([one.id in own.buildings for one in buildings], bool)
    found = np.zeros(len(charts), bool)
    built = charts.building >= 0
    found[built] = mine[charts.building[built]]
    ground = np.flatnonzero(~built)
    if not len(ground):
        return found
    order = [*sorted(range(len(buildings)), key=lambda i: buildings[i].id)]
    lines = sorted(range(len(streets)), key=lambda i: streets[i].id)
    shapes = [*(buildings[i].footprint for i in order), *(streets[i].line for i in lines)]
    owned = np.array([*(mine[i] for i in order), *(streets[i].id in own.streets for i in lines)], bool)
    middles = shapely.points(charts.points_at_shares(ground, np.array([[0.5, 0.5]]))[:, 0, :2])
    which, nearest = shapely.STRtree(shapes).query_nearest(middles, all_matches=True)
    first = np.full(len(ground), len(shapes))
    np.minimum.at(first, which, nearest)
    found[ground] = owned[first]
    return found


def core_viewpoints(
    cameras: Sequence[Viewpoint],
    streets: Sequence[Street],
    buildings: Sequence[Building],
    own: CoreRegion,
    visibility_range: float,
) -> list[Viewpoint]:
    """The viewpoints of a block's own streets, and those from which one of its buildings is seen, or seen to be near; with
    numbers of their own."""
    mine = shapely.STRtree([one.footprint for one in buildings if one.id in own.buildings])
    places = shapely.points(np.array([camera.position[:2] for camera in cameras]).reshape(-1, 2))
    near = np.zeros(len(cameras), bool)
    if len(cameras):
        near[mine.query(places, predicate="dwithin", distance=max(visibility_range, HALF_DENSITY_M))[0]] = True
    kept = [one for one, seen in zip(cameras, near, strict=True) if seen or streets[one.street].id in own.streets]
    return [replace(camera, id=number) for number, camera in enumerate(kept)]


def core_facades(facades: Facades, buildings: Sequence[Building], own: CoreRegion) -> Facades:
    """The facades of a block's own buildings."""
    mine = np.array([one.id in own.buildings for one in buildings], bool)
    rows = np.flatnonzero(mine[facades.building]) if len(facades) else np.zeros(0, np.int64)
    place = np.full(len(facades), -1, np.int32)
    place[rows] = np.arange(len(rows), dtype=np.int32)
    columns = {field.name: getattr(facades, field.name) for field in fields(facades)}
    kept = {name: column[rows] for name, column in columns.items() if name != "id"}
    kept["run"] = place[kept["run"]]  # what is laid out as one is of one building
    return Facades(id=tuple(facades.id[row] for row in rows.tolist()), **kept)


def core_streets(
    streets: Sequence[Street], cameras: Sequence[Viewpoint], facades: Facades, own: CoreRegion
) -> tuple[tuple[Street, ...], list[int], list[Viewpoint], Facades]:
    """A block's own streets, with those that its facades are on; which viewpoints are of its own; both, and the facades, with
    the numbers that streets have then."""
    named = set(facades.street.tolist())
    kept = [i for i, street in enumerate(streets) if street.id in own.streets or i in named]
    number = {street: i for i, street in enumerate(kept)}
    rows = [row for row, camera in enumerate(cameras) if streets[camera.street].id in own.streets]
    walked = [replace(cameras[row], id=i, street=number[cameras[row].street]) for i, row in enumerate(rows)]
    on = np.array([number[street] for street in facades.street.tolist()], np.int32)
    return tuple(streets[i] for i in kept), rows, walked, replace(facades, street=on)
