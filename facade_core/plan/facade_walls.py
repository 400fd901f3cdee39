"""A facade's wall as its building's storeys lie on it, and what of it stands free."""

from __future__ import annotations

from collections.abc import Sequence

import shapely
from shapely.affinity import translate

from facade_core.facade.texture.storeys import FacadeWall
from facade_core.geometry.scene import Scene
from facade_core.geometry.walls import WallRole, free_wall_area
from facade_core.plan.doors import has_back_door, turns_corner
from facade_core.plan.facades import Facades


def facade_wall(scene: Scene, facades: Facades, facade: int, entrances: Sequence[float] = ()) -> FacadeWall:
    """The wall that a facade is, or is a part of: all that are laid out as one with it, from left to right. entrances: where a
    map has doors in it, metres from the left."""
    own = facades.run_members(facade)
    parts = [
        translate(free_wall_area(scene.charts, scene.mesh, int(facades.chart[one]))[1], xoff=float(facades.along[one]))
        for one in own.tolist()
    ]
    return FacadeWall(
        width=float((facades.along[own] + facades.width[own]).max()),
        height=float(facades.height[facade]),
        foot=float(facades.foot[facade]),
        eaves=float(facades.eaves[facade]),
        storeys=int(facades.storeys[facade]),
        street=int(facades.role[facade]) == WallRole.STREET,
        plain=int(facades.role[facade]) == WallRole.BACK,
        free=shapely.union_all(parts),
        raised=bool(facades.raised[facade]),
        seams=tuple(facades.along[own][1:].tolist()),
        corner=turns_corner(scene.charts, facades, facade),
        door=has_back_door(facades, facade),
        entrances=tuple(entrances),
    )
