"""The frame of a facade: the columns and floors that its windows stand in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.types import Element
from facade_core.facade.layout.grids import box_array

Box = tuple[float, float, float, float]

# Windows whose centres differ by less than this share of their size stand in one column or floor.
ONE_LINE = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class FacadeFrame:
    """The facade's columns and floors as its windows show them: centres, and the windows' median size.

    floor_size (floors, 2): median width and height of the windows of a floor; ground: where doors and shops stand.
    """

    columns: np.ndarray
    floors: np.ndarray
    floor_size: np.ndarray
    size: np.ndarray
    ground: float


def fit_facade_frame(seen: Sequence[Element], domain: Box) -> FacadeFrame:
    """The frame of what is seen; sizes come from all elements where no window is seen, from the domain without any."""
    standing = [e.y1 for e in seen if e.label in ("door", "shop")]
    ground = max(standing) if standing and max(standing) > domain[3] - 0.15 * (domain[3] - domain[1]) else domain[3]
    box = box_array([e for e in seen if e.label == "window"] or seen)
    if not len(box):
        extent = np.array([domain[2] - domain[0], domain[3] - domain[1]])
        return FacadeFrame(np.zeros(0), np.zeros(0), np.zeros((0, 2)), extent * (0.06, 0.09), ground)
    centre, side = (box[:, :2] + box[:, 2:]) / 2, box[:, 2:] - box[:, :2]
    size = np.median(side, axis=0)
    columns, _ = cluster_centres(centre[:, 0], ONE_LINE * size[0])
    floors, floor = cluster_centres(centre[:, 1], ONE_LINE * size[1])
    floor_size = np.array([np.median(side[floor == k], axis=0) for k in range(len(floors))])
    return FacadeFrame(columns, floors, floor_size, size, ground)


def cluster_centres(values: np.ndarray, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Means of the runs of values that lie less than `gap` apart, and the run of each value."""
    order = np.argsort(values, kind="stable")
    run = np.empty(len(values), int)
    run[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > gap)])
    return np.bincount(run, values) / np.bincount(run), run
