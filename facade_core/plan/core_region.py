"""Core region of a block in a city: the part that the block textures, within a halo that is only seen."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray
from facade_core.core.types import Building, Street
from facade_core.geometry.charts import Charts
from facade_core.geometry.settings import TEXEL_DENSITY
from facade_core.geometry.streets import Viewpoint
from facade_core.plan.facades import Facades


@dataclass(frozen=True)
class CoreRegion:
    """Ids of the buildings and streets in a block's core; the others are halo."""

    buildings: Collection[str]
    streets: Collection[str]


def core_chart_mask(
    charts: Charts, buildings: Sequence[Building], streets: Sequence[Street], core: CoreRegion
) -> BoolArray:
    """Return the mask (n,) bool of the charts in the core.

    These are charts of core buildings, and ground charts whose nearest building or street is in the core. Buildings
    precede streets, and lower ids precede higher ones at equal distance.

    Parameters
    ----------
    buildings : all buildings, in the order of `Charts.building`.
    streets : all streets.
    core : the core.
    """
    mine = np.array([one.id in core.buildings for one in buildings], bool)
    found = np.zeros(len(charts), bool)
    built = charts.building >= 0
    found[built] = mine[charts.building[built]]
    ground = np.flatnonzero(~built)
    if not len(ground):
        return found
    order = [*sorted(range(len(buildings)), key=lambda i: buildings[i].id)]
    lines = sorted(range(len(streets)), key=lambda i: streets[i].id)
    shapes = [*(buildings[i].footprint for i in order), *(streets[i].line for i in lines)]
    owned = np.array([*(mine[i] for i in order), *(streets[i].id in core.streets for i in lines)], bool)
    middles = shapely.points(charts.points_at_shares(ground, np.array([[0.5, 0.5]]))[:, 0, :2])
    which, nearest = shapely.STRtree(shapes).query_nearest(middles, all_matches=True)
    first = np.full(len(ground), len(shapes))
    np.minimum.at(first, which, nearest)
    found[ground] = owned[first]
    return found


def core_viewpoints(
    viewpoints: Sequence[Viewpoint],
    streets: Sequence[Street],
    buildings: Sequence[Building],
    core: CoreRegion,
    visibility_range: float,
) -> list[Viewpoint]:
    """Return the viewpoints of core streets or near core buildings, renumbered.

    Parameters
    ----------
    viewpoints : all viewpoints.
    streets : all streets.
    buildings : all buildings.
    core : the core.
    visibility_range : metres.
    """
    mine = shapely.STRtree([one.footprint for one in buildings if one.id in core.buildings])
    places = shapely.points(np.array([camera.position[:2] for camera in viewpoints]).reshape(-1, 2))
    near = np.zeros(len(viewpoints), bool)
    if len(viewpoints):
        near[
            mine.query(places, predicate="dwithin", distance=max(visibility_range, TEXEL_DENSITY.half_density_m))[0]
        ] = True
    kept = [one for one, seen in zip(viewpoints, near, strict=True) if seen or streets[one.street].id in core.streets]
    return [replace(camera, id=number) for number, camera in enumerate(kept)]


def core_facades(facades: Facades, buildings: Sequence[Building], core: CoreRegion) -> Facades:
    """Return the facades of core buildings."""
    mine = np.array([one.id in core.buildings for one in buildings], bool)
    rows = np.flatnonzero(mine[facades.building]) if len(facades) else np.zeros(0, np.int64)
    place = np.full(len(facades), -1, np.int32)
    place[rows] = np.arange(len(rows), dtype=np.int32)
    columns = {field.name: getattr(facades, field.name) for field in fields(facades)}
    kept = {name: column[rows] for name, column in columns.items() if name != "id"}
    kept["run"] = place[kept["run"]]  # runs do not cross buildings
    return Facades(id=tuple(facades.id[row] for row in rows.tolist()), **kept)


def restrict_to_core_streets(
    streets: Sequence[Street], viewpoints: Sequence[Viewpoint], facades: Facades, core: CoreRegion
) -> tuple[tuple[Street, ...], list[int], list[Viewpoint], Facades]:
    """Restrict streets to the core and its facades, and renumber viewpoints and facades.

    Parameters
    ----------
    streets : all streets.
    viewpoints : the viewpoints.
    facades : the facades of the core.
    core : the core.

    Returns
    -------
    Streets; rows of the viewpoints on core streets; these viewpoints; the facades.
    """
    named = set(facades.street.tolist())
    kept = [i for i, street in enumerate(streets) if street.id in core.streets or i in named]
    number = {street: i for i, street in enumerate(kept)}
    rows = [row for row, camera in enumerate(viewpoints) if streets[camera.street].id in core.streets]
    walked = [replace(viewpoints[row], id=i, street=number[viewpoints[row].street]) for i, row in enumerate(rows)]
    on = np.array([number[street] for street in facades.street.tolist()], np.int32)
    return tuple(streets[i] for i in kept), rows, walked, replace(facades, street=on)
