"""A block's plan: what ingest makes of it and every later stage reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from facade_core.core.grouping import RowIndex
from facade_core.core.types import Ground, Pose, Street
from facade_core.geometry.charts import CORNER_SHARES, ChartKind
from facade_core.geometry.ground.shapes import GroundTiles
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.geometry.walls import is_main_surface
from facade_core.imagery.poses.panorama_camera import GROUND_REACH_M, WALL_REACH_M
from facade_core.plan.facades import Facades
from facade_core.plan.identity import SceneObjects, build_scene_objects

__all__ = ["Facades", "Plan", "Sightings"]

# Metres; refinement moves a pose by less.
MAX_POSE_SHIFT_M = 3.0


@dataclass(frozen=True)
class Sightings:
    """Which panoramas show which facade, as columns, best first within a facade: facade, panorama (s,) int32 indices; seen (s,)
    the share of the facade that the panorama shows; pixels_per_metre (s,) the panorama's resolution on it."""

    facade: np.ndarray
    panorama: np.ndarray
    seen: np.ndarray
    pixels_per_metre: np.ndarray

    def panoramas_showing(self, facade: int) -> np.ndarray:
        """The panoramas that show a facade, best first."""
        return self.panorama[self._of_facade.rows_with(facade)]

    @cached_property
    def _of_facade(self) -> RowIndex:
        return RowIndex(self.facade)


@dataclass(frozen=True)
class Plan:
    """A block's geometry and the order of its work.

    streets are the given ones, or those derived from the gaps; ground is what lies between the buildings; poses are those of
    the block's panoramas, on the ground where they had no height. refused: buildings without usable surfaces, as (id,
    reason). textured (charts,) bool: charts with a texture of the source's own, or on a picture from above. views (k, 2)
    int32: pairs of viewpoint and chart, sorted: what each viewpoint's panorama shows; writable (charts,) bool: charts that
    the street stage writes; wave (streets,) int32. ids (charts,) uint64 and looks (viewpoints,) digests say what each chart
    is and each viewpoint sees, wherever it stands in the order. own (charts,) bool: what is textured and published; the rest,
    of a block that is a part of a city, is only seen.
    """

    scene: Scene
    streets: tuple[Street, ...]
    ground: Ground
    facades: Facades
    poses: tuple[Pose, ...]
    rejected_buildings: tuple[tuple[str, str], ...]
    sightings: Sightings
    textured: np.ndarray
    viewpoints: tuple[Viewpoint, ...]
    views: np.ndarray
    writable: np.ndarray
    wave: np.ndarray
    ids: np.ndarray
    view_digests: tuple[str, ...]
    in_core: np.ndarray

    @cached_property
    def scene_objects(self) -> SceneObjects:
        """What stands in the block."""
        return build_scene_objects(self.scene.charts, self.scene.mesh, self.scene.names)

    def ground_digests(self, charts: Sequence[int]) -> list[str]:
        """Of each ground chart among some the digest of what its ground is drawn of."""
        return [
            self._squares.digest(chart).hex() for chart in charts if self.scene.charts.kind[chart] == ChartKind.GROUND
        ]

    @cached_property
    def _squares(self) -> GroundTiles:
        return GroundTiles(self.ground, self.scene.charts)

    def buildings_with_textures(self) -> tuple[int, ...]:
        """The buildings that have textures of their own besides those on facades."""
        return self._textured_buildings

    @cached_property
    def _textured_buildings(self) -> tuple[int, ...]:
        return tuple(np.unique(self.scene.charts.building[self._own_charts]).tolist())

    def is_facade(self, chart: int) -> bool:
        """Whether a chart is a facade."""
        return len(self._facade_of_chart.rows_with(chart)) > 0

    @cached_property
    def _facade_of_chart(self) -> RowIndex:
        return RowIndex(self.facades.chart)

    def textured_charts(self, building: int) -> list[int]:
        """The charts of a building, its facades aside, that have textures of their own."""
        return self._own_charts[self._own_by_building.rows_with(building)].tolist()

    @cached_property
    def _own_charts(self) -> np.ndarray:
        """The charts (k,) with textures of their own that are no facades."""
        others = self.textured & self.in_core
        others[self.facades.chart] = False
        return np.flatnonzero(others)

    @cached_property
    def _own_by_building(self) -> RowIndex:
        return RowIndex(self.scene.charts.building[self._own_charts])

    def ground_near_cameras(self) -> np.ndarray:
        """The pieces (k,) int64 of the block's own ground, ascending, that a panorama may show: refining moves poses little."""
        return self._ground_near_cameras

    @cached_property
    def _ground_near_cameras(self) -> np.ndarray:
        ground = np.flatnonzero((self.scene.charts.kind == ChartKind.GROUND) & self.in_core)
        if not self.poses or not len(ground):
            return np.zeros(0, np.int64)
        corners = self.scene.charts.points_at_shares(ground, CORNER_SHARES)[..., :2]
        boxes = shapely.box(*corners.min(axis=1).T, *corners.max(axis=1).T)
        places = shapely.MultiPoint([(pose.x, pose.y) for pose in self.poses])
        return ground[shapely.distance(boxes, places) <= GROUND_REACH_M + MAX_POSE_SHIFT_M]

    def walls_near_cameras(self) -> dict[int, list[int]]:
        """By building, ascending, the block's own walls and roofs that are no facades, have no texture of their own, and that a
        panorama may show."""
        return self._walls_near_cameras

    @cached_property
    def _walls_near_cameras(self) -> dict[int, list[int]]:
        charts = self.scene.charts
        plain = is_main_surface(charts) & self.in_core & ~self.textured
        plain[self.facades.chart] = False
        plain_charts = np.flatnonzero(plain)
        if not self.poses or not len(plain_charts):
            return {}
        places = np.array([(pose.x, pose.y, pose.z) for pose in self.poses])
        tree = shapely.STRtree(shapely.points(places[:, :2]))
        row, of = tree.query(charts.boxes[plain_charts], predicate="dwithin", distance=WALL_REACH_M + MAX_POSE_SHIFT_M)
        chart = plain_charts[row]
        before = np.einsum("ij,ij->i", places[of] - charts.origin[chart], charts.normals()[chart]) > -MAX_POSE_SHIFT_M
        found: dict[int, list[int]] = {}
        for one in np.unique(chart[before]).tolist():
            found.setdefault(int(charts.building[one]), []).append(one)
        return dict(sorted(found.items()))

    @cached_property
    def street_of_viewpoints(self) -> np.ndarray:
        """The street of every viewpoint, (viewpoints,) int64."""
        return np.array([viewpoint.street for viewpoint in self.viewpoints], np.int64)

    def street_viewpoints(self, street: int) -> list[Viewpoint]:
        """A street's viewpoints in their order."""
        return [self.viewpoints[row] for row in self._by_street.rows_with(street).tolist()]

    @cached_property
    def _by_street(self) -> RowIndex:
        return RowIndex(self.street_of_viewpoints)

    @cached_property
    def street_charts(self) -> np.ndarray:
        """Pairs of street and chart, (k, 2) int64, sorted: what the viewpoints of each street show."""
        return np.unique(np.column_stack([self.street_of_viewpoints[self.views[:, 0]], self.views[:, 1]]), axis=0)

    def charts_of_street(self, street: int) -> np.ndarray:
        """The charts (k,) int64 that the viewpoints of a street show, ascending."""
        return self.street_charts[self._charts_by_street.rows_with(street), 1]

    @cached_property
    def _charts_by_street(self) -> RowIndex:
        return RowIndex(self.street_charts[:, 0])

    def streets_of_charts(self, charts: np.ndarray) -> np.ndarray:
        """The rows (k, 2) of street_charts that are of some charts (n,)."""
        return self.street_charts[self._streets_by_chart.rows_with_any(charts)]

    @cached_property
    def _streets_by_chart(self) -> RowIndex:
        return RowIndex(self.street_charts[:, 1])

    def charts_of_viewpoint(self, viewpoint: int) -> np.ndarray:
        """The charts (k,) int32 that a viewpoint shows, ascending."""
        return self.views[self._charts_by_viewpoint.rows_with(viewpoint), 1]

    @cached_property
    def _charts_by_viewpoint(self) -> RowIndex:
        return RowIndex(self.views[:, 0])

    def views_of_charts(self, charts: np.ndarray) -> np.ndarray:
        """The rows (k, 2) of views that are of some charts (n,)."""
        return self.views[self._views_by_chart.rows_with_any(charts)]

    @cached_property
    def _views_by_chart(self) -> RowIndex:
        return RowIndex(self.views[:, 1])

    def texel_counts(self) -> np.ndarray:
        """Texels of every chart, (charts,) int64."""
        return self.scene.placement.width.astype(np.int64) * self.scene.placement.height

    def building_pictures(self) -> dict[int, list[int]]:
        """The pictures that the textures of each building use, ascending, by building."""
        mesh = self.scene.mesh
        used = mesh.texture >= 0
        pairs = np.column_stack([self.scene.charts.building[mesh.chart[used]], mesh.texture[used]])
        pictures: dict[int, list[int]] = {}
        for building, picture in np.unique(pairs, axis=0).tolist():
            pictures.setdefault(building, []).append(picture)
        return pictures

    def street_texels(self) -> np.ndarray:
        """Per street the texels of the charts that its viewpoints see, and of those that it writes, (streets, 2) int64."""
        seen = self.street_charts
        texels = self.texel_counts()
        total = np.zeros((len(self.wave), 2), np.int64)
        np.add.at(total, seen[:, 0], np.column_stack([texels, texels * self.writable])[seen[:, 1]])
        return total
