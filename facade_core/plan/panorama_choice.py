"""Greedy set cover: the fewest panoramas that show all visible facades."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.geometry.walls import WallRole
from facade_core.imagery.rectify.panorama import chart_point_view_quality, nearby_panoramas
from facade_core.plan.facades import Facades
from facade_core.plan.settings import PANORAMA_CHOICE


@dataclass(frozen=True)
class PanoramaChoice:
    """Chosen panoramas and their coverage.

    Attributes
    ----------
    chosen : indices of panoramas in the order of choice.
    covering_panoramas : number of panoramas that cover a point of a facade.
    facades : number of street facades.
    facades_shown : number of these that a panorama shows.
    shown, reached : square metres of facades that all panoramas show, and that the chosen ones cover.
    """

    chosen: tuple[int, ...]
    covering_panoramas: int
    facades: int
    facades_shown: int
    shown: float
    reached: float


def choose_panoramas(
    scene: Scene, facades: Facades, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]]
) -> PanoramaChoice:
    """Choose panoramas so that every visible street facade is covered.

    Greedy rule: repeatedly the panorama that adds most square metres, the earlier of equals; then redundant ones are
    dropped, last chosen first. At most ln(points) times the optimum.

    Parameters
    ----------
    poses : poses of the panoramas.
    sizes : (rows, columns) of the panoramas.

    References
    ----------
    Chvatal (1979), A greedy heuristic for the set-covering problem.
    """
    rows = np.flatnonzero(facades.role == WallRole.STREET)
    points = _facade_points(scene, facades.chart[rows], poses, sizes)
    needs = points.facade_sums(points.weight) * PANORAMA_CHOICE.min_covered_share
    has = np.zeros(len(rows))
    left = points.weight.copy()
    chosen: list[int] = []
    while len(poses):
        left[has[points.facade] >= needs[points.facade]] = 0.0
        gains = points.covers @ left
        best = int(gains.argmax())
        if gains[best] <= 0:
            break
        chosen.append(best)
        has += points.facade_sums(points.is_covered_by(best) * left)
        left[points.is_covered_by(best)] = 0.0
    kept = _drop_redundant(points, needs, chosen)
    reached = float(points.weight[points.coverage_counts(kept) > 0].sum())
    covering = int((np.diff(points.covers.indptr) > 0).sum())
    return PanoramaChoice(tuple(kept), covering, len(rows), int((needs > 0).sum()), float(points.weight.sum()), reached)


def coverage_area(
    scene: Scene, facades: Facades, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]], panoramas: Sequence[int]
) -> float:
    """Return the square metres of street facades that some panoramas cover.

    Parameters
    ----------
    poses : poses of the panoramas.
    sizes : (rows, columns) of the panoramas.
    panoramas : indices of the panoramas to count.
    """
    points = _facade_points(scene, facades.chart[facades.role == WallRole.STREET], poses, sizes)
    return float(points.weight[points.coverage_counts(panoramas) > 0].sum())


@dataclass(frozen=True)
class _FacadePoints:
    """Points of facades that panoramas show.

    Attributes
    ----------
    covers : (panoramas, points) sparse, 1 where a panorama covers a point.
    weight : (points,) square metres of each point.
    facade : (points,) position of its facade.
    facades : number of facades.
    """

    covers: sparse.csr_array
    weight: Float64Array
    facade: Int64Array
    facades: int

    def is_covered_by(self, panorama: int) -> BoolArray:
        """Return whether a panorama covers each point, (points,)."""
        return self.coverage_counts([panorama]) > 0

    def coverage_counts(self, panoramas: Sequence[int]) -> Float64Array:
        """Return the number of some panoramas that cover each point, (points,)."""
        return np.asarray(self.covers[list(panoramas)].sum(axis=0)).ravel() if panoramas else np.zeros(len(self.weight))

    def facade_sums(self, weight: Float64Array) -> Float64Array:
        """Return the sum of a weight of points per facade, (facades,)."""
        return np.asarray(np.bincount(self.facade, weight, self.facades), np.float64)


def _facade_points(
    scene: Scene, charts: Int32Array, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]]
) -> _FacadePoints:
    near = nearby_panoramas(scene, charts, poses)
    panorama, point, weight, facade = [], [], [], []
    total = 0
    for place, (chart, some) in enumerate(zip(charts.tolist(), near, strict=True)):
        shown = chart_point_view_quality(
            scene, chart, [poses[i] for i in some.tolist()], [sizes[i] for i in some.tolist()]
        )
        best = shown.max(axis=0, initial=0.0)
        row, column = np.nonzero((shown > 0) & (shown >= PANORAMA_CHOICE.min_relative_quality * best))
        known = np.flatnonzero(best > 0)
        panorama.append(some[row])
        point.append(total + np.searchsorted(known, column))
        weight.append(np.full(len(known), float(np.prod(scene.charts.size[chart])) / max(len(best), 1)))
        facade.append(np.full(len(known), place))
        total += len(known)
    rows, columns = (np.concatenate([*some, np.zeros(0, np.int64)]) for some in (panorama, point))
    covers = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(poses), total))
    return _FacadePoints(
        covers, np.concatenate([*weight, np.zeros(0)]), np.concatenate([*facade, np.zeros(0, np.int64)]), len(charts)
    )


def _drop_redundant(points: _FacadePoints, needs: Float64Array, chosen: Sequence[int]) -> list[int]:
    """Return the chosen panoramas without those whose points the others cover."""
    kept, times = list(chosen), points.coverage_counts(chosen)
    for one in reversed(chosen):
        without = times - points.is_covered_by(one)
        if (points.facade_sums(points.weight * (without > 0)) >= needs).all():
            kept.remove(one)
            times = without
    return kept
