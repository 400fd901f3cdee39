"""The panoramas that surfaces are taken from: their refined poses, one exposure for all, and which are near a surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from catalogs.block.reader import Block
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import CORNER_SHARES, Charts
from facade_core.imagery.cameras.exposure import exposure_factors
from facade_core.plan.plan import Plan
from tasks.stages.poses.record import PoseRecord
from tasks.stages.shared.refined_poses import read_refined_poses, select_pose
from tasks.stages.shared.surface_panorama import PosedPanorama

# Panoramas at most that a surface is taken from, the nearest to its middle: with pieces of ground of 32 m and a panorama each
# five metres all that see it from a street.
CAMERAS = 8
# Each wall and roof of a building that is longer, seen from above, metres, is taken from panoramas of its own; and one that is
# itself from those near each of its pieces: who stands before an end may be far from the middle.
LONG_M = 32.0


@dataclass(frozen=True)
class Cameras:
    """The usable panoramas of a block, and their places as a tree."""

    taken: tuple[PosedPanorama, ...]
    places: shapely.STRtree

    def near(self, corners: np.ndarray, reach: float) -> tuple[PosedPanorama, ...]:
        """Those within `reach` metres of the box, seen from above, of some corners (k, 2), at most CAMERAS, in their order."""
        low, high = corners.min(axis=0), corners.max(axis=0)
        found = self.places.query(shapely.box(*low, *high), predicate="dwithin", distance=reach)
        middle = (low + high) / 2

        def away(i: int) -> tuple[float, int]:
            pose = self.taken[i].pose
            return float(np.hypot(pose.x - middle[0], pose.y - middle[1])), i

        return tuple(self.taken[i] for i in sorted(sorted(found.tolist(), key=away)[:CAMERAS]))

    def of_building(self, charts: Charts, some: Sequence[int], reach: float) -> list[tuple[PosedPanorama, ...]]:
        """Those that each of some charts (k,) of a building is taken from: of a short one all charts from the same."""
        corners = charts.points_at_shares(np.array(some), CORNER_SHARES)[..., :2].reshape(-1, 2)
        if np.ptp(corners, axis=0).max() <= LONG_M:
            return [self.near(corners, reach)] * len(some)
        return [self.before(charts, chart, reach) for chart in some]

    def before(self, charts: Charts, chart: int, reach: float) -> tuple[PosedPanorama, ...]:
        """Those that a chart faces and that are within `reach` metres of it, seen from above: in turn the nearest to the middle
        of each of its pieces, at most CAMERAS, in their order."""
        corners = _pieces(charts, chart)
        piece, camera = self.places.query(shapely.convex_hull(shapely.multipoints(corners)), "dwithin", reach)
        faced = (self._where[camera] - charts.origin[chart]) @ charts.normals()[chart] > 0
        piece, camera = piece[faced], camera[faced]
        away = np.linalg.norm(self._where[camera, :2] - corners.mean(axis=1)[piece], axis=1)
        order = np.lexsort((camera, away, piece))
        piece, camera = piece[order], camera[order]
        turn = np.arange(len(piece)) - np.searchsorted(piece, piece)
        chosen = list(dict.fromkeys(camera[np.lexsort((piece, turn))].tolist()))
        return tuple(self.taken[i] for i in sorted(chosen[:CAMERAS]))

    @cached_property
    def _where(self) -> np.ndarray:
        """The places (n, 3) of all, metres."""
        return np.array([(one.pose.x, one.pose.y, one.pose.z) for one in self.taken]).reshape(-1, 3)


def cameras_of_block(
    block: Block, plan: Plan, group: StoreGroup, usable: Callable[[PoseRecord | None], bool]
) -> Cameras:
    """As the journal stands: poses that are refined, and what their pictures show of the ground; those that are usable by their
    record."""
    records = read_refined_poses(group)
    squares = [_squares(record) for record in records]
    gains = exposure_factors(squares)
    taken = tuple(
        PosedPanorama(panorama.path, select_pose(pose, record), tuple(gain), own)
        for panorama, pose, record, gain, own in zip(
            block.panoramas, plan.poses, records, gains.tolist(), squares, strict=True
        )
        if usable(record)
    )
    return Cameras(
        taken, shapely.STRtree(shapely.points(np.array([(t.pose.x, t.pose.y) for t in taken]).reshape(-1, 2)))
    )


def _pieces(charts: Charts, chart: int) -> np.ndarray:
    """The corners (p, 4, 2), seen from above, of the pieces that a chart is cut into across its longer side there: of at most
    LONG_M each, but no more than CAMERAS."""
    axes = np.stack([charts.axis_u[chart], charts.axis_v[chart]])
    sides = np.linalg.norm(axes[:, :2], axis=1) * charts.size[chart]
    count = int(np.clip(np.ceil(sides.max() / LONG_M), 1, CAMERAS))
    share = np.tile(CORNER_SHARES.astype(np.float64), (count, 1, 1))
    across = int(sides.argmax())
    share[..., across] = (np.arange(count)[:, None] + CORNER_SHARES[:, across]) / count
    return charts.points_at_shares(np.array([chart]), share.reshape(-1, 2))[0, :, :2].reshape(count, 4, 2)


def _squares(record: PoseRecord | None) -> tuple[tuple[int, ...], ...]:
    return tuple(tuple(square) for square in record.get("squares", ())) if record else ()
