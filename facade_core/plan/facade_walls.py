"""Walls of facades for texturing, with their floors and free parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.affinity import translate

from facade_core.core.arrays import BoolArray, Int64Array
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.geometry.scene import Scene
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.geometry.walls import WallRole, wall_outline_and_free_part
from facade_core.plan.doors import has_back_door, is_corner_facade
from facade_core.plan.facades import Facades


def facade_wall(scene: Scene, facades: Facades, facade: int, entrances: Sequence[float] = ()) -> FacadeWall:
    """Return the wall of a facade, or of the run that it is part of, from left to right.

    Parameters
    ----------
    facade : index of the facade.
    entrances : mapped doors, metres from the left.
    """
    own = facades.run_members(facade)
    parts = [
        translate(
            wall_outline_and_free_part(scene.charts, scene.mesh, int(facades.chart[one]))[1],
            xoff=float(facades.along[one]),
        )
        for one in own.tolist()
    ]
    return FacadeWall(
        width=float((facades.along[own] + facades.width[own]).max()),
        height=float(facades.height[facade]),
        foot=float(facades.foot[facade]),
        eaves=float(facades.eaves[facade]),
        floors=int(facades.storeys[facade]),
        on_street=int(facades.role[facade]) == WallRole.STREET,
        is_back=int(facades.role[facade]) == WallRole.BACK,
        free=shapely.union_all(parts),
        is_raised=bool(facades.raised[facade]),
        seams=tuple(facades.along[own][1:][_is_sharp(scene, facades, own)].tolist()),
        is_corner=is_corner_facade(scene.charts, facades, facade),
        has_back_door=has_back_door(facades, facade),
        entrances=tuple(entrances),
    )


def _is_sharp(scene: Scene, facades: Facades, own: Int64Array) -> BoolArray:
    """Return the seams (k - 1,) between the facades (k,) of a run that no window may cross, as it would bend."""
    narrow, normals = facades.width[own] < FACADE_WALLS.max_unrolled_facet_m, scene.charts.normals()[facades.chart[own]]
    slight = np.einsum("ij,ij->i", normals[:-1], normals[1:]) > FACADE_WALLS.min_unrolled_cosine
    is_sharp: BoolArray = ~(narrow[:-1] & narrow[1:] & slight)
    return is_sharp
