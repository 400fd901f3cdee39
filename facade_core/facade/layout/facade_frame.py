"""Columns and floors of a facade, from the positions of its windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import Float64Array, Int64Array
from facade_core.core.types import Element
from facade_core.facade.layout.grids import ALIGNMENT_TOLERANCE, box_array

# x0, y0, x1, y1 in the unit of the facade.
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class ColumnsAndFloors:
    """Columns, floors and window sizes of a facade, and its ground line.

    Attributes
    ----------
    columns : (C,) x of column centres, ascending.
    floors : (F,) y of floor centres, ascending.
    floor_size : (F, 2) median width and height of the windows of each floor.
    size : (2,) median width and height of all windows.
    ground : y of the ground line of doors and shops.
    """

    columns: Float64Array
    floors: Float64Array
    floor_size: Float64Array
    size: Float64Array
    ground: float


def fit_columns_and_floors(seen: Sequence[Element], domain: Rectangle) -> ColumnsAndFloors:
    """Fit columns and floors to observed elements.

    Without windows, sizes come from all elements; without any element, from the domain.

    Parameters
    ----------
    seen : observed elements.
    domain : (x0, y0, x1, y1) of the facade, y down.
    """
    standing = [e.y1 for e in seen if e.label in ("door", "shop")]
    ground = max(standing) if standing and max(standing) > domain[3] - 0.15 * (domain[3] - domain[1]) else domain[3]
    box = box_array([e for e in seen if e.label == "window"] or seen)
    if not len(box):
        extent = np.array([domain[2] - domain[0], domain[3] - domain[1]])
        return ColumnsAndFloors(np.zeros(0), np.zeros(0), np.zeros((0, 2)), extent * (0.06, 0.09), ground)
    centre, side = (box[:, :2] + box[:, 2:]) / 2, box[:, 2:] - box[:, :2]
    size = np.median(side, axis=0)
    columns, _ = cluster_positions_by_gap(centre[:, 0], ALIGNMENT_TOLERANCE * size[0])
    floors, floor = cluster_positions_by_gap(centre[:, 1], ALIGNMENT_TOLERANCE * size[1])
    floor_size = np.array([np.median(side[floor == k], axis=0) for k in range(len(floors))])
    return ColumnsAndFloors(columns, floors, floor_size, size, ground)


def cluster_positions_by_gap(values: Float64Array, gap: float) -> tuple[Float64Array, Int64Array]:
    """Cluster positions whose neighbours differ by at most `gap`.

    Parameters
    ----------
    values : (N,) positions in any order.
    gap : largest distance between neighbours of one cluster.

    Returns
    -------
    (K,) cluster means, ascending, and (N,) cluster index of each value.
    """
    order = np.argsort(values, kind="stable")
    run = np.empty(len(values), int)
    run[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > gap)])
    return np.bincount(run, values) / np.bincount(run), run
