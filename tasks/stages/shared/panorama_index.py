"""Index of posed pictures, by which those of a surface are selected."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from facade_core.core.arrays import AnyArray, BoolArray, Float64Array, IntArray
from facade_core.core.fixed_order import multiply_matrices
from facade_core.geometry.charts import CORNER_SHARES, Charts
from facade_core.imagery.panorama_camera import (
    WALL_REACH_M,
    camera_position,
    camera_reach,
    is_any_in_view,
    is_in_view,
    project_directions_to_picture,
)
from tasks.stages.shared.surface_panorama import SurfacePanorama

# Panoramas at most that a surface is taken from: with pieces of ground of 32 m and a panorama each five metres all that see it
# from a street.
MAX_PANORAMAS_PER_SURFACE = 8
# Of a block with pictures of a lens, pictures at most that a piece of ground is taken from: each shows a small part of it.
MAX_PICTURES_PER_GROUND = 24
# Pictures of a point of the ground that are enough of it: some are hidden, and two must agree.
ENOUGH_PICTURES = 4
# Points nearer to a picture than this, metres, are not better shown by it: the size of its view limits what it shows of them.
MIN_COVERING_DISTANCE_M = 3.0
# Length in plan, metres, above which a wall or roof gets its own panoramas instead of those of its building. A surface longer
# than this itself uses the panoramas near each of its pieces: a panorama in front of an end may be far from the middle.
MAX_PIECE_M = 32.0
# Points on a surface, as shares of its sides: a picture of a lens must have one of them in view.
VIEW_SHARES = np.stack(np.meshgrid(np.linspace(0, 1, 7), np.linspace(0, 1, 7)), axis=-1).reshape(-1, 2)
# The same of a piece of ground: every two metres.
GROUND_SHARES = np.stack(np.meshgrid(np.linspace(0, 1, 17), np.linspace(0, 1, 17)), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class UsablePanoramaIndex:
    """Spatial index of the usable panoramas of a block."""

    panoramas: tuple[SurfacePanorama, ...]

    @cached_property
    def places(self) -> shapely.STRtree:
        """Return the tree of the panoramas' places on the map."""
        return shapely.STRtree(shapely.points(np.array([(t.pose.x, t.pose.y) for t in self.panoramas]).reshape(-1, 2)))

    def near(
        self, charts: Charts, some: Sequence[int], reach: float, preferred: Set[int] = frozenset()
    ) -> tuple[SurfacePanorama, ...]:
        """Select the panoramas near some charts on the map: the MAX_PANORAMAS_PER_SURFACE nearest to the middle.

        Pictures of a lens that show none of them do not count. In a block with such pictures, those are taken that show most
        together, as many as bring every point to ENOUGH_PICTURES, at most MAX_PICTURES_PER_GROUND.

        Parameters
        ----------
        some : charts.
        reach : distance from their box, metres; of aerial pictures larger.
        preferred : panoramas that count as half as far where many show the charts.
        """
        corners = charts.points_at_shares(np.array(some), CORNER_SHARES)[..., :2].reshape(-1, 2)
        low, high = corners.min(axis=0), corners.max(axis=0)
        box = shapely.box(*low, *high)
        near = self.places.query(box, predicate="dwithin", distance=self._largest_reach(reach))
        points = charts.points_at_shares(np.array(some), GROUND_SHARES).reshape(-1, 3)
        found = near[self._may_show(near, np.broadcast_to(box, len(near)), points, reach)]
        middle = (low + high) / 2

        def away(i: int) -> tuple[float, int]:
            pose = self.panoramas[i].pose
            return float(np.hypot(pose.x - middle[0], pose.y - middle[1])), i

        cameras = sorted(found.tolist(), key=away)
        if not self._has_lenses:
            cameras = cameras[:MAX_PANORAMAS_PER_SURFACE]
        elif len(cameras) > MAX_PANORAMAS_PER_SURFACE:
            cameras = self._select_covering(
                cameras, points, reach, MAX_PICTURES_PER_GROUND, preferred, enough=ENOUGH_PICTURES
            )
        return tuple(self.panoramas[i] for i in sorted(cameras))

    def select_by_chart(
        self, charts: Charts, some: Sequence[int], preferred: Set[int] = frozenset()
    ) -> list[tuple[SurfacePanorama, ...]]:
        """Select the panoramas of each chart of a building; a short building shares them."""
        corners = charts.points_at_shares(np.array(some), CORNER_SHARES)[..., :2].reshape(-1, 2)
        if np.ptp(corners, axis=0).max() <= MAX_PIECE_M and not self._has_lenses:
            return [self.near(charts, some, WALL_REACH_M)] * len(some)
        return [self.facing(charts, chart, preferred) for chart in some]

    def facing(self, charts: Charts, chart: int, preferred: Set[int] = frozenset()) -> tuple[SurfacePanorama, ...]:
        """Select the panoramas in front of a chart, at most MAX_PANORAMAS_PER_SURFACE.

        They are chosen in turn: the nearest to the middle of each piece of the chart; in a block with pictures of a lens
        those that show most together.
        """
        corners = _chart_pieces(charts, chart)
        pieces = shapely.convex_hull(shapely.multipoints(corners))
        piece, camera = self.places.query(pieces, "dwithin", self._largest_reach(WALL_REACH_M))
        points = charts.points_at_shares(np.array([chart]), VIEW_SHARES)[0]
        faced = multiply_matrices(self._positions[camera] - charts.origin[chart], charts.normals()[chart]) > 0
        faced &= self._may_show(camera, pieces[piece], points, WALL_REACH_M)
        piece, camera = piece[faced], camera[faced]
        away = np.linalg.norm(self._positions[camera, :2] - corners.mean(axis=1)[piece], axis=1)
        order = np.lexsort((camera, away, piece))
        piece, camera = piece[order], camera[order]
        turn = np.arange(len(piece)) - np.searchsorted(piece, piece)
        chosen = list(dict.fromkeys(camera[np.lexsort((piece, turn))].tolist()))
        if len(chosen) > MAX_PANORAMAS_PER_SURFACE and self._has_lenses:
            chosen = self._select_covering(chosen, points, WALL_REACH_M, MAX_PANORAMAS_PER_SURFACE, preferred)
        return tuple(self.panoramas[i] for i in sorted(chosen[:MAX_PANORAMAS_PER_SURFACE]))

    def _select_covering(
        self,
        cameras: list[int],
        points: Float64Array,
        reach: float,
        limit: int,
        preferred: Set[int],
        *,
        enough: float = np.inf,
    ) -> list[int]:
        """Select the cameras that show most of the points (n, 3) together, each point from near and by several of them.

        Each next camera is the one with the largest sum over the points in its view of the inverse distance, halved for each
        camera that shows the point already; points that `enough` cameras show do not count. The first of equals comes first.
        """
        gains = np.zeros((len(cameras), len(points)))
        for gain, camera in zip(gains, cameras, strict=True):
            pose = self.panoramas[camera].pose
            rays = points - camera_position(pose)
            distance = np.linalg.norm(rays, axis=1)
            shown = (distance <= camera_reach(pose, reach)) & is_in_view(
                project_directions_to_picture(rays, pose), pose
            )
            gain[shown] = (2 if camera in preferred else 1) / np.maximum(distance[shown], MIN_COVERING_DISTANCE_M)
        left, times = list(range(len(cameras))), np.zeros(len(points))
        chosen: list[int] = []
        while left and len(chosen) < limit:
            weight = 0.5**times * (times < enough)
            values = (gains[left] * weight).sum(axis=1)  # the same bits for any number of threads
            if not values.any():
                break
            best = left.pop(int(values.argmax()))
            chosen.append(best)
            times += gains[best] > 0
        return [cameras[i] for i in chosen]

    def _may_show(self, cameras: IntArray, shapes: AnyArray, points: Float64Array, reach: float) -> BoolArray:
        """Test (k,) whether cameras are near enough to their shapes on the map, and have one of the points (n, 3) in view."""
        if not self._has_lenses:
            return np.ones(len(cameras), bool)
        limits = np.maximum(reach, self._least_reaches[cameras])
        near: BoolArray = shapely.distance(self.places.geometries[cameras], shapes) <= limits
        in_view = {i: is_any_in_view(self.panoramas[i].pose, points) for i in np.unique(cameras[near]).tolist()}
        near[near] = [in_view[i] for i in cameras[near].tolist()]
        return near

    def _largest_reach(self, reach: float) -> float:
        return float(self._least_reaches.max(initial=reach))

    @cached_property
    def _least_reaches(self) -> Float64Array:
        """Return the distances (n,) to which cameras are used even where the limit is 0: aerial pictures, metres."""
        return np.array([camera_reach(one.pose, 0.0) for one in self.panoramas], np.float64)

    @cached_property
    def _has_lenses(self) -> bool:
        return any(one.pose.lens is not None for one in self.panoramas)

    @cached_property
    def _positions(self) -> Float64Array:
        """Return all positions (n, 3), metres."""
        return np.array([(one.pose.x, one.pose.y, one.pose.z) for one in self.panoramas]).reshape(-1, 3)


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
