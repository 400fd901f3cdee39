"""Plan of a block, the result of ingest and input of all later stages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b

import numpy as np
import shapely

from facade_core.core.arrays import BoolArray, Float64Array, Int32Array, Int64Array, ObjectArray, UInt64Array
from facade_core.core.grouping import RowsByValue
from facade_core.core.street_objects import NO_OBJECTS, PlacedObjects
from facade_core.core.surrounding_mesh import NO_SURROUNDINGS, SurroundingMesh
from facade_core.core.types import MappedGround, Pose, Street
from facade_core.geometry.charts import CORNER_SHARES, ChartKind
from facade_core.geometry.ground.shapes import GroundTiles
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.geometry.walls import main_surface_mask
from facade_core.imagery.panorama_camera import GROUND_REACH_M, WALL_REACH_M, camera_reach
from facade_core.plan.facades import Facades
from facade_core.plan.identity import SceneObjects, build_scene_objects
from facade_core.plan.settings import PLANNING

__all__ = ["FacadeSightings", "Facades", "Plan"]


@dataclass(frozen=True)
class FacadeSightings:
    """Sightings of facades in panoramas as columns, in the order of `order_by_coverage` within a facade.

    Attributes
    ----------
    facade, panorama : (s,) indices.
    seen : (s,) share of the facade that the panorama shows.
    pixels_per_metre : (s,) resolution of the panorama on the facade.
    """

    facade: Int32Array
    panorama: Int32Array
    seen: Float64Array
    pixels_per_metre: Float64Array

    @classmethod
    def empty(cls) -> FacadeSightings:
        """Return no sightings."""
        return cls(np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros(0), np.zeros(0))

    def panoramas_showing(self, facade: int) -> Int32Array:
        """Return the panoramas that show a facade, those first that show most of it together."""
        return self.panorama[self._of_facade.rows_with(facade)]

    @cached_property
    def _of_facade(self) -> RowsByValue:
        return RowsByValue(self.facade)


@dataclass(frozen=True)
class Plan:
    """Geometry of a block and the order of its work.

    Attributes
    ----------
    scene : charts, mesh and their places in the atlas.
    streets : given streets, or those derived from the gaps.
    ground : mapped ground between the buildings.
    facades : facades of the block.
    poses : poses of the panoramas, all with a height.
    rejected_buildings : buildings without usable surfaces as (id, reason).
    sightings : facades in panoramas.
    textured : (charts,) True with a texture of the source, or from a picture from above.
    viewpoints : viewpoints along the streets.
    views : (k, 2) sorted pairs of viewpoint and chart in its panorama.
    writable : (charts,) True where no facade and no texture of the source writes.
    ids : (charts,) chart ids.
    view_digests : (viewpoints,) digests of everything that a viewpoint sees.
    in_core : (charts,) True in the core region, which is textured and published; the halo is only seen.
    street_density : (charts,) texels per metre by the streets, before pictures raise that of facades.
    objects : trees, lamps and other objects on the ground.
    surroundings : buildings and ground around the block.
    """

    scene: Scene
    streets: tuple[Street, ...]
    ground: MappedGround
    facades: Facades
    poses: tuple[Pose, ...]
    rejected_buildings: tuple[tuple[str, str], ...]
    sightings: FacadeSightings
    textured: BoolArray
    viewpoints: tuple[Viewpoint, ...]
    views: Int32Array
    writable: BoolArray
    ids: UInt64Array
    view_digests: tuple[str, ...]
    in_core: BoolArray
    street_density: Float64Array
    objects: PlacedObjects = NO_OBJECTS
    surroundings: SurroundingMesh = NO_SURROUNDINGS

    @cached_property
    def scene_objects(self) -> SceneObjects:
        """Return the objects of the block."""
        return build_scene_objects(self.scene.charts, self.scene.mesh, self.scene.names)

    @cached_property
    def surroundings_digest(self) -> str:
        """Return the digest of what stands and lies around the block."""
        placed, around = self.objects, self.surroundings
        digest = blake2b("\n".join(placed.id).encode(), digest_size=16)
        for values in (*list(vars(placed).values())[1:], *vars(around).values()):
            digest.update(values.tobytes())
        return digest.hexdigest()

    def ground_digests(self, charts: Sequence[int]) -> list[str]:
        """Return the digests of the ground on the ground charts among some charts."""
        return [
            self._squares.digest(chart).hex() for chart in charts if self.scene.charts.kind[chart] == ChartKind.GROUND
        ]

    @cached_property
    def _squares(self) -> GroundTiles:
        return GroundTiles(self.ground, self.scene.charts)

    def buildings_with_textures(self) -> tuple[int, ...]:
        """Return the buildings with source textures besides those on facades."""
        return self._textured_buildings

    @cached_property
    def _textured_buildings(self) -> tuple[int, ...]:
        return tuple(np.unique(self.scene.charts.building[self._own_charts]).tolist())

    def is_facade(self, chart: int) -> bool:
        """Return whether a chart is a facade."""
        return len(self._facade_of_chart.rows_with(chart)) > 0

    @cached_property
    def _facade_of_chart(self) -> RowsByValue:
        return RowsByValue(self.facades.chart)

    def list_textured_charts(self, building: int) -> list[int]:
        """Return the charts of a building, without facades, that have source textures."""
        charts: list[int] = self._own_charts[self._own_by_building.rows_with(building)].tolist()
        return charts

    @cached_property
    def _own_charts(self) -> Int64Array:
        """Return the charts (k,) with source textures that are no facades."""
        others = self.textured & self.in_core
        others[self.facades.chart] = False
        return np.flatnonzero(others)

    @cached_property
    def _own_by_building(self) -> RowsByValue:
        return RowsByValue(self.scene.charts.building[self._own_charts])

    def ground_near_cameras(self) -> Int64Array:
        """Return the ground charts (k,) of the core, ascending, that a panorama may show after refinement of its pose."""
        return self._ground_near_cameras

    @cached_property
    def _ground_near_cameras(self) -> Int64Array:
        ground = np.flatnonzero((self.scene.charts.kind == ChartKind.GROUND) & self.in_core)
        if not self.poses or not len(ground):
            return np.zeros(0, np.int64)
        corners = self.scene.charts.points_at_shares(ground, CORNER_SHARES)[..., :2]
        boxes = shapely.box(*corners.min(axis=1).T, *corners.max(axis=1).T)
        _, near = self._near_cameras(boxes, GROUND_REACH_M)
        found: Int64Array = ground[np.unique(near)]
        return found

    def _near_cameras(self, shapes: ObjectArray, reach: float) -> tuple[Int64Array, Int64Array]:
        """Return the pairs of a camera (k,) and a shape (k,) that it may show, by its reach and the change of its pose."""
        limits = [camera_reach(pose, reach) + PLANNING.max_pose_shift_m for pose in self.poses]
        places = shapely.points([(pose.x, pose.y) for pose in self.poses])
        camera, near = shapely.STRtree(shapes).query(places, predicate="dwithin", distance=limits)
        return camera, near

    def walls_near_cameras(self) -> dict[int, list[int]]:
        """Return by building the plain walls and roofs of the core, no facades, that a panorama may show."""
        return self._walls_near_cameras

    @cached_property
    def _walls_near_cameras(self) -> dict[int, list[int]]:
        charts = self.scene.charts
        plain = main_surface_mask(charts) & self.in_core & ~self.textured
        plain[self.facades.chart] = False
        plain_charts = np.flatnonzero(plain)
        if not self.poses or not len(plain_charts):
            return {}
        places = np.array([(pose.x, pose.y, pose.z) for pose in self.poses])
        of, row = self._near_cameras(charts.boxes[plain_charts], WALL_REACH_M)
        chart = plain_charts[row]
        before = (
            np.einsum("ij,ij->i", places[of] - charts.origin[chart], charts.normals()[chart])
            > -PLANNING.max_pose_shift_m
        )
        found: dict[int, list[int]] = {}
        for one in np.unique(chart[before]).tolist():
            found.setdefault(int(charts.building[one]), []).append(one)
        return dict(sorted(found.items()))

    @cached_property
    def viewpoint_streets(self) -> Int64Array:
        """Return the street of every viewpoint, (viewpoints,)."""
        return np.array([viewpoint.street for viewpoint in self.viewpoints], np.int64)

    def street_viewpoints(self, street: int) -> list[Viewpoint]:
        """Return the viewpoints of a street in their order."""
        return [self.viewpoints[row] for row in self._by_street.rows_with(street).tolist()]

    @cached_property
    def _by_street(self) -> RowsByValue:
        return RowsByValue(self.viewpoint_streets)

    @cached_property
    def street_charts(self) -> Int64Array:
        """Return the sorted pairs of street and chart in its panoramas, (k, 2)."""
        return np.unique(np.column_stack([self.viewpoint_streets[self.views[:, 0]], self.views[:, 1]]), axis=0)

    def charts_of_street(self, street: int) -> Int64Array:
        """Return the charts (k,) in the panoramas of a street, ascending."""
        charts: Int64Array = self.street_charts[self._charts_by_street.rows_with(street), 1]
        return charts

    @cached_property
    def _charts_by_street(self) -> RowsByValue:
        return RowsByValue(self.street_charts[:, 0])

    def charts_of_viewpoint(self, viewpoint: int) -> Int32Array:
        """Return the charts (k,) in the panorama of a viewpoint, ascending."""
        charts: Int32Array = self.views[self._charts_by_viewpoint.rows_with(viewpoint), 1]
        return charts

    @cached_property
    def _charts_by_viewpoint(self) -> RowsByValue:
        return RowsByValue(self.views[:, 0])

    def select_view_rows(self, charts: Int64Array) -> Int32Array:
        """Return the rows (k, 2) of views with some charts (n,)."""
        return self.views[self._views_by_chart.rows_with_any(charts)]

    @cached_property
    def _views_by_chart(self) -> RowsByValue:
        return RowsByValue(self.views[:, 1])

    def texel_counts(self) -> Int64Array:
        """Return the number of texels of every chart, (charts,)."""
        return self.scene.placement.width.astype(np.int64) * self.scene.placement.height

    def building_pictures(self) -> dict[int, list[int]]:
        """Return the source pictures of each building's textures, ascending, by building."""
        mesh = self.scene.mesh
        used = mesh.texture >= 0
        pairs = np.column_stack([self.scene.charts.building[mesh.chart[used]], mesh.texture[used]])
        pictures: dict[int, list[int]] = {}
        for building, picture in np.unique(pairs, axis=0).tolist():
            pictures.setdefault(building, []).append(picture)
        return pictures
