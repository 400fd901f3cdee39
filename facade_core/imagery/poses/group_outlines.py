"""Alignment of overlapping photos as one to the outlines of a model: corners and eaves that one photo shows too few of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.types import Pose
from facade_core.geometry.scene import Scene
from facade_core.imagery.panorama_camera import camera_position, rotate_pose, rotation_about_z
from facade_core.imagery.poses.outlines import (
    Gradients,
    OutlineSamples,
    image_gradients,
    outline_fit,
    sample_visible_outlines,
)
from facade_core.imagery.poses.settings import ALIGNMENT, GROUP_OUTLINES

# Unknowns of a change: along, across and up in metres, turn in degrees, logarithm of the scale.
CHANGES = 5


@dataclass(frozen=True, slots=True, eq=False)
class OutlineAlignment:
    """Photos aligned to outlines.

    Attributes
    ----------
    centres : (n, 3) cameras, metres.
    rotation : (3, 3) by which the cameras turned, in the frame of the block.
    given_fit : fit of the outlines before, 0 to 1.
    fit : the same after, before the last refinement on finer pictures.
    """

    centres: Float64Array
    rotation: Float64Array
    given_fit: float
    fit: float


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Cameras, axes (3, 3) along their line, across it and up, and their places as `align_to_outlines` is given them."""

    centres: Float64Array
    axes: Float64Array
    gps: Float64Array
    height: Float64Array

    def move(self, change: Float64Array) -> Float64Array:
        """Return the centres (n, 3) after a change (CHANGES,); it turns clockwise from above."""
        middle = self.centres.mean(axis=0)
        turned = (self.centres - middle) @ rotation_about_z(-float(change[3])).T
        return np.asarray(middle + change[:3] @ self.axes + np.exp(change[4]) * turned)

    def prior(self, change: Float64Array) -> float:
        """Return the squares of the errors of the mean height and the heading, in their standard errors."""
        up = (self.move(change)[:, 2] - self.height).mean()
        return float((up / ALIGNMENT.height_sigma_m) ** 2 + (change[3] / GROUP_OUTLINES.heading_sigma_deg) ** 2)

    def gps_misfit(self, change: Float64Array) -> float:
        """Return the sum of squares of GPS in its standard errors; an outlier counts max_gps_sigmas."""
        off = self.move(change)[:, :2] - self.gps
        squares = (off[np.isfinite(off).all(axis=1)] ** 2).sum(axis=1) / ALIGNMENT.gps_sigma_m**2
        return float(np.minimum(squares, ALIGNMENT.max_gps_sigmas**2).sum())


def align_to_outlines(
    scene: Scene,
    poses: Sequence[Pose],
    read: Callable[[int], UInt8Array],
    gps: Float64Array,
    height: Float64Array,
) -> OutlineAlignment | None:
    """Align photos of known relative poses to the outlines of the buildings that they show together.

    A shift, a turn about the vertical and a scale of all cameras, by a grid and simplexes: walls determine neither the place
    along a plain row of houses nor the scale of photos of one side, and GPS to a metre only.

    Parameters
    ----------
    scene : scene that contains the model.
    poses : n poses with lenses, aligned to its walls.
    read : returns the picture (h, w, 3) uint8 of a pose; of any scale.
    gps : (n, 2) measured places, NaN where unknown.
    height : (n,) expected heights of the cameras, metres in the frame of the block.

    Returns
    -------
    The alignment; None where the outlines do not fit clearly better than before.
    """
    chosen = np.unique(
        np.linspace(0, len(poses) - 1, min(len(poses), GROUP_OUTLINES.max_photos)).round().astype(int)
    ).tolist()
    centres = np.array([camera_position(pose) for pose in poses])
    line = np.linalg.svd(centres[:, :2] - centres[:, :2].mean(axis=0), full_matrices=False)[2][0]
    axes = np.array([[*line, 0.0], [-line[1], line[0], 0.0], [0.0, 0.0, 1.0]])
    given = _Group(centres, axes, gps, height)
    search, coarse = (
        _Comparison(scene, given, poses, read, chosen, resolution)
        for resolution in (GROUP_OUTLINES.search_resolution, GROUP_OUTLINES.coarse_resolution)
    )
    no_change, first_steps = np.zeros(CHANGES), np.array(GROUP_OUTLINES.first_steps)
    largest = given.gps_misfit(no_change) + GROUP_OUTLINES.max_gps_increase
    grid = [one for one in _search_grid() if given.gps_misfit(one) <= largest]
    order = np.argsort([search.cost(one) for one in grid], kind="stable")
    change = min(
        (coarse.refine(grid[i], first_steps) for i in order[: GROUP_OUTLINES.max_starts].tolist()), key=coarse.cost
    )
    is_better = coarse.cost(no_change) - coarse.cost(change) >= GROUP_OUTLINES.min_cost_decrease
    if not is_better or coarse.fit(change) < GROUP_OUTLINES.min_fit or given.gps_misfit(change) > largest:
        return None
    turn = rotation_about_z(-float(change[3]))
    moved = _Group(given.move(change), axes, gps, height)
    nearer = [_move_pose(pose, turn, centre) for pose, centre in zip(poses, moved.centres, strict=True)]
    last = _Comparison(scene, moved, nearer, read, chosen, GROUP_OUTLINES.fine_resolution).refine(
        no_change, first_steps / 2
    )
    if moved.gps_misfit(last) > largest:
        last = no_change
    rotation = rotation_about_z(-float(last[3])) @ turn
    return OutlineAlignment(moved.move(last), rotation, coarse.fit(no_change), coarse.fit(change))


def _search_grid() -> Float64Array:
    """Return the changes (k, 5) that are tried; the given place is the first of equals."""
    along, across, scale = (
        np.arange(-round(reach / step), round(reach / step) + 1) * step
        for reach, step in (
            GROUP_OUTLINES.search_along_m,
            GROUP_OUTLINES.search_across_m,
            GROUP_OUTLINES.search_log_scale,
        )
    )
    grid = np.stack(np.meshgrid(along, across, 0.0, 0.0, scale, indexing="ij"), axis=-1).reshape(-1, CHANGES)
    return np.asarray(grid[np.argsort((grid**2).sum(axis=1), kind="stable")])


class _Comparison:
    """Outlines of a model against the edges of some photos of a group."""

    def __init__(
        self,
        scene: Scene,
        group: _Group,
        poses: Sequence[Pose],
        read: Callable[[int], UInt8Array],
        chosen: Sequence[int],
        resolution: tuple[int, float],
    ) -> None:
        self.group = group
        self.gps_before = group.gps_misfit(np.zeros(CHANGES))
        self.shown: list[tuple[int, Pose, OutlineSamples, Gradients]] = []
        for number in chosen:
            outline = sample_visible_outlines(scene, poses[number])
            if outline.weight.sum() > 0:
                picture = image_gradients(read(number), poses[number], *resolution)
                self.shown.append((number, poses[number], outline, picture))

    def fit(self, change: Float64Array) -> float:
        """Return the fit of all outlines after a change, 0 to 1."""
        offsets = self.group.move(change) - self.group.centres
        total = weights = 0.0
        for number, pose, outline, picture in self.shown:
            weight = float(outline.weight.sum())
            total += weight * outline_fit(outline, picture, pose, offsets[number], float(change[3]))
            weights += weight
        return total / weights if weights else 0.0

    def cost(self, change: Float64Array) -> float:
        """Return what a search minimises."""
        prior = self.group.gps_misfit(change) - self.gps_before + self.group.prior(change)
        return GROUP_OUTLINES.prior_cost * prior - self.fit(change)

    def refine(self, start: Float64Array, steps: Float64Array) -> Float64Array:
        """Return the change of least cost near one."""
        from scipy.optimize import minimize

        corners = start + np.vstack([np.zeros(CHANGES), np.diag(steps)])
        options = {"initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-5, "maxiter": 300}
        return np.asarray(minimize(self.cost, start, method="Nelder-Mead", options=options).x)


def _move_pose(pose: Pose, turn: Float64Array, centre: Float64Array) -> Pose:
    x, y, z = centre.tolist()
    return replace(rotate_pose(pose, turn), x=x, y=y, z=z)
