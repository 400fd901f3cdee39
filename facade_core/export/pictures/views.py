"""Views of a block: choice of their cameras, and painting."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from facade_core.atlas.journal import Record
from facade_core.core.arrays import Float64Array, Int64Array, UInt8Array
from facade_core.core.types import Sun
from facade_core.export.pictures.camera import PerspectiveCamera, aerial_camera, close_up_camera, street_camera
from facade_core.export.pictures.rendering import SmoothPicture
from facade_core.export.pictures.settings import BLOCK_VIEWS
from facade_core.geometry.walls import WallRole
from facade_core.plan.plan import Plan
from facade_core.street.lighting.sun import sun_direction

# Height and width of a view, pixels.
VIEW_SIZE = (900, 1440)

T = TypeVar("T")


class ProvenanceShares(Record, total=False):
    """Part of a facade's record: the share of its texels of each provenance."""

    provenance: list[float]


def view_names(plan: Plan) -> list[str]:
    """Return the names of a block's views: from above, along streets, and close to a facade."""
    near = ["close-up"] if len(plan.facades.chart) else []
    return ["above", *(f"street-{number}" for number in range(len(_view_streets(plan)))), *near]


def select_pictured_facades(plan: Plan) -> Int64Array:
    """Select the facades (k,) with pictures: those on streets."""
    return np.flatnonzero(plan.facades.role == WallRole.STREET)


def choose_cameras(
    plan: Plan, records: Sequence[ProvenanceShares | None], sun: Sun | None = None
) -> list[PerspectiveCamera]:
    """Choose the cameras of `view_names` by the worth of visible facades: photos first, sunlit ones before shaded.

    Parameters
    ----------
    plan : plan of the block.
    records : journal records of the facades.
    sun : position of the sun; None ignores it.
    """
    worth = _chart_worth(plan, records, sun)
    found = [aerial_camera(plan.scene, VIEW_SIZE, worth)]
    found += [_street_view_camera(plan, street, VIEW_SIZE, worth) for street in _view_streets(plan)]
    if len(plan.facades.chart):
        found.append(close_up_camera(plan.scene, plan.facades.chart, VIEW_SIZE, worth))
    return found


def choose_preview_camera(plan: Plan, size: tuple[int, int]) -> PerspectiveCamera | None:
    """Choose the camera of the first view along a street before any facade is made; None without a street."""
    streets = _view_streets(plan)
    if not streets or not (plan.facades.role == WallRole.STREET).any():
        return None
    return _street_view_camera(plan, streets[0], size, _chart_worth(plan, [None] * len(plan.facades.chart), None))


def _street_view_camera(plan: Plan, street: int, size: tuple[int, int], worth: Float64Array) -> PerspectiveCamera:
    own = pick_evenly_spaced(plan.street_viewpoints(street), BLOCK_VIEWS.max_viewpoints_tried)
    return street_camera(plan.scene, own, size, worth)


def _chart_worth(plan: Plan, records: Sequence[ProvenanceShares | None], sun: Sun | None) -> Float64Array:
    """Return the worth (n,) of showing each chart; zero for all but facades on streets."""
    worth = np.zeros(len(plan.scene.charts))
    for chart, role, record in zip(plan.facades.chart, plan.facades.role, records, strict=True):
        worth[chart] = role == WallRole.STREET and 1 + BLOCK_VIEWS.photo_worth * photo_share(record)
    if sun is not None:
        worth *= np.where(plan.scene.charts.normals() @ sun_direction(sun) > 0, 1.0, BLOCK_VIEWS.shaded_worth)
    return worth


def photo_share(record: ProvenanceShares | None) -> float:
    """Return the share of a facade from photos, by its record."""
    return record.get("provenance", [0.0])[-1] if record else 0.0


def paint_view(picture: SmoothPicture, parts: Iterable[Mapping[int, UInt8Array]]) -> UInt8Array:
    """Paint a view from rasters by chart, some charts at a time, (h, w, 3) uint8."""
    for rasters in parts:
        picture.paint(rasters)
    return picture.finish()


def pick_evenly_spaced(values: list[T], count: int) -> list[T]:
    """Return at most `count` values, evenly spaced."""
    if len(values) <= count:
        return values
    return [values[round(i * (len(values) - 1) / (count - 1))] for i in range(count)]


def _view_streets(plan: Plan) -> list[int]:
    """Return the streets with a view: those with the most facade area, not back lanes."""
    facades = plan.facades
    area = np.bincount(
        facades.street, facades.width * facades.height * (facades.role == WallRole.STREET), minlength=len(plan.streets)
    )
    walked = np.unique(plan.viewpoint_streets)
    most = walked[np.argsort(-area[walked], kind="stable")][: BLOCK_VIEWS.max_street_views]
    return sorted(most.tolist())
