"""Panoramas near a surface, with refined poses and a common exposure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from catalogs.block.reader import Block
from facade_core.core.arrays import AnyArray, BoolArray, Float64Array, IntArray
from facade_core.core.types import Pose
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import CORNER_SHARES, Charts
from facade_core.imagery.cameras.exposure import estimate_common_exposure
from facade_core.imagery.panorama_camera import camera_reach, is_any_in_view
from facade_core.plan.plan import Plan
from tasks.stages.bundles.refined_poses import pose_from_record, read_bundled_pose_records
from tasks.stages.poses.record import PoseRecord
from tasks.stages.shared.surface_panorama import SurfacePanorama

# Panoramas at most that a surface is taken from, the nearest to its middle: with pieces of ground of 32 m and a panorama each
# five metres all that see it from a street.
MAX_PANORAMAS_PER_SURFACE = 8
# Length in plan, metres, above which a wall or roof gets its own panoramas instead of those of its building. A surface longer
# than this itself uses the panoramas near each of its pieces: a panorama in front of an end may be far from the middle.
MAX_PIECE_M = 32.0
# Places on a surface, as shares of its sides, of which a picture of a lens must have one in view.
VIEW_SHARES = np.stack(np.meshgrid(np.linspace(0, 1, 7), np.linspace(0, 1, 7)), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class UsablePanoramaIndex:
    """Spatial index of the usable panoramas of a block."""

    panoramas: tuple[SurfacePanorama, ...]
    places: shapely.STRtree

    def near(self, charts: Charts, some: Sequence[int], reach: float) -> tuple[SurfacePanorama, ...]:
        """Select the panoramas near some charts on the map, at most MAX_PANORAMAS_PER_SURFACE.

        Pictures of a lens that show none of them do not count.

        Parameters
        ----------
        some : charts.
        reach : distance from their box, metres; of aerial pictures larger.
        """
        corners = charts.points_at_shares(np.array(some), CORNER_SHARES)[..., :2].reshape(-1, 2)
        low, high = corners.min(axis=0), corners.max(axis=0)
        box = shapely.box(*low, *high)
        near = self.places.query(box, predicate="dwithin", distance=self._largest_reach(reach))
        points = charts.points_at_shares(np.array(some), VIEW_SHARES).reshape(-1, 3)
        found = near[self._may_show(near, np.broadcast_to(box, len(near)), points, reach)]
        middle = (low + high) / 2

        def away(i: int) -> tuple[float, int]:
            pose = self.panoramas[i].pose
            return float(np.hypot(pose.x - middle[0], pose.y - middle[1])), i

        return tuple(self.panoramas[i] for i in sorted(sorted(found.tolist(), key=away)[:MAX_PANORAMAS_PER_SURFACE]))

    def select_by_chart(self, charts: Charts, some: Sequence[int], reach: float) -> list[tuple[SurfacePanorama, ...]]:
        """Select the panoramas of each chart of a building; a short building shares them."""
        corners = charts.points_at_shares(np.array(some), CORNER_SHARES)[..., :2].reshape(-1, 2)
        if np.ptp(corners, axis=0).max() <= MAX_PIECE_M and not self._has_lenses:
            return [self.near(charts, some, reach)] * len(some)
        return [self.facing(charts, chart, reach) for chart in some]

    def facing(self, charts: Charts, chart: int, reach: float) -> tuple[SurfacePanorama, ...]:
        """Select the panoramas in front of a chart, at most MAX_PANORAMAS_PER_SURFACE.

        They are chosen in turn: the nearest to the middle of each piece of the chart.
        """
        corners = _chart_pieces(charts, chart)
        pieces = shapely.convex_hull(shapely.multipoints(corners))
        piece, camera = self.places.query(pieces, "dwithin", self._largest_reach(reach))
        points = charts.points_at_shares(np.array([chart]), VIEW_SHARES)[0]
        faced = (self._positions[camera] - charts.origin[chart]) @ charts.normals()[chart] > 0
        faced &= self._may_show(camera, pieces[piece], points, reach)
        piece, camera = piece[faced], camera[faced]
        away = np.linalg.norm(self._positions[camera, :2] - corners.mean(axis=1)[piece], axis=1)
        order = np.lexsort((camera, away, piece))
        piece, camera = piece[order], camera[order]
        turn = np.arange(len(piece)) - np.searchsorted(piece, piece)
        chosen = list(dict.fromkeys(camera[np.lexsort((piece, turn))].tolist()))
        return tuple(self.panoramas[i] for i in sorted(chosen[:MAX_PANORAMAS_PER_SURFACE]))

    def _may_show(self, cameras: IntArray, shapes: AnyArray, points: Float64Array, reach: float) -> BoolArray:
        """Test (k,) whether cameras are near enough to their shapes on the map, and have one of the points (n, 3) in view."""
        if not self._has_lenses:
            return np.ones(len(cameras), bool)
        limits = np.array([camera_reach(self.panoramas[i].pose, reach) for i in cameras.tolist()])
        in_view = {i: is_any_in_view(self.panoramas[i].pose, points) for i in np.unique(cameras).tolist()}
        shown = np.array([in_view[i] for i in cameras.tolist()], bool)
        near: BoolArray = shown & (shapely.distance(self.places.geometries[cameras], shapes) <= limits)
        return near

    def _largest_reach(self, reach: float) -> float:
        return max((camera_reach(one.pose, reach) for one in self.panoramas), default=reach)

    @cached_property
    def _has_lenses(self) -> bool:
        return any(one.pose.lens is not None for one in self.panoramas)

    @cached_property
    def _positions(self) -> Float64Array:
        """Return all positions (n, 3), metres."""
        return np.array([(one.pose.x, one.pose.y, one.pose.z) for one in self.panoramas]).reshape(-1, 3)


def index_usable_panoramas(
    block: Block, plan: Plan, group: StoreGroup, usable: Callable[[Pose, PoseRecord | None], bool]
) -> UsablePanoramaIndex:
    """Index the panoramas with a usable record, with refined poses and exposure factors."""
    records = read_bundled_pose_records(group)
    squares = [ground_squares(record) for record in records]
    gains = estimate_common_exposure(squares).factors
    taken = tuple(
        SurfacePanorama(panorama.path, pose_from_record(pose, record), tuple(gain), own)
        for panorama, pose, record, gain, own in zip(
            block.panoramas, plan.poses, records, gains.tolist(), squares, strict=True
        )
        if usable(pose, record)
    )
    return UsablePanoramaIndex(
        taken, shapely.STRtree(shapely.points(np.array([(t.pose.x, t.pose.y) for t in taken]).reshape(-1, 2)))
    )


def _chart_pieces(charts: Charts, chart: int) -> Float64Array:
    """Return the corners (p, 4, 2), seen from above, of the pieces of a chart.

    It is cut across its longer side into pieces of at most MAX_PIECE_M.
    """
    axes = np.stack([charts.axis_u[chart], charts.axis_v[chart]])
    sides = np.linalg.norm(axes[:, :2], axis=1) * charts.size[chart]
    count = int(np.clip(np.ceil(sides.max() / MAX_PIECE_M), 1, MAX_PANORAMAS_PER_SURFACE))
    share = np.tile(CORNER_SHARES.astype(np.float64), (count, 1, 1))
    across = int(sides.argmax())
    share[..., across] = (np.arange(count)[:, None] + CORNER_SHARES[:, across]) / count
    return charts.points_at_shares(np.array([chart]), share.reshape(-1, 2))[0, :, :2].reshape(count, 4, 2)


def ground_squares(record: PoseRecord | None) -> tuple[tuple[int, ...], ...]:
    """Return the squares of ground that a panorama shows, by its record."""
    return tuple(tuple(square) for square in record.get("squares", ())) if record else ()
