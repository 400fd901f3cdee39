"""Ingest: buildings and streets into everything the later stages need to know about a block's geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from facade_core.atlas.spec import AtlasSpec
from facade_core.facades import Facades, find_facades
from facade_core.geometry.gaps import streets_between
from facade_core.geometry.packing import Places, pack
from facade_core.geometry.streets import Viewpoint, colour_waves, viewpoints
from facade_core.geometry.surfaces import block_surfaces
from facade_core.geometry.terrain import terrain_of
from facade_core.identity import Things, chart_ids, look_around, things_of
from facade_core.rectify import sightings
from facade_core.street.scene import Scene
from facade_core.types import Building, Elevation, Pose, Street

__all__ = ["Facades", "Plan", "Sightings", "ingest"]


@dataclass(frozen=True)
class Sightings:
    """Which panoramas show which facade, as columns, best first within a facade: facade, panorama (s,) int32 indices; seen (s,)
    the share of the facade that the panorama shows; pixels_per_metre (s,) the panorama's resolution on it."""

    facade: np.ndarray
    panorama: np.ndarray
    seen: np.ndarray
    pixels_per_metre: np.ndarray

    def of(self, facade: int) -> np.ndarray:
        """The panoramas that show a facade, best first."""
        return self.panorama[self.facade == facade]


@dataclass(frozen=True)
class Plan:
    """A block's geometry and the order of its work.

    streets are the given ones, or those derived from the gaps; poses are those of the block's panoramas, on the ground
    where they had no height. refused: buildings without usable surfaces, as (id, reason). textured (charts,) bool: charts
    with a texture of the source's own, or on a picture from above. views (k, 2) int32: pairs of viewpoint and chart,
    sorted: what each viewpoint's panorama shows; writable (charts,) bool: charts that the street stage writes; wave
    (streets,) int32. ids (charts,) uint64 and looks (viewpoints,) digests say what each chart is and each viewpoint sees,
    wherever it stands in the order.
    """

    scene: Scene
    streets: tuple[Street, ...]
    facades: Facades
    poses: tuple[Pose, ...]
    refused: tuple[tuple[str, str], ...]
    sightings: Sightings
    textured: np.ndarray
    viewpoints: tuple[Viewpoint, ...]
    views: np.ndarray
    writable: np.ndarray
    wave: np.ndarray
    ids: np.ndarray
    looks: tuple[str, ...]

    @cached_property
    def things(self) -> Things:
        """What stands in the block."""
        return things_of(self.scene.charts, self.scene.mesh, self.scene.names)

    def textured_buildings(self) -> tuple[int, ...]:
        """The buildings that have textures of their own besides those on facades."""
        others = self.textured.copy()
        others[self.facades.chart] = False
        return tuple(np.unique(self.scene.charts.building[others]).tolist())

    def own_charts(self, building: int) -> list[int]:
        """The charts of a building, its facades aside, that have textures of their own."""
        mine = self.textured & (self.scene.charts.building == building)
        mine[self.facades.chart] = False
        return np.flatnonzero(mine).tolist()

    def of_street(self, street: int) -> list[Viewpoint]:
        """A street's viewpoints in their order."""
        return [viewpoint for viewpoint in self.viewpoints if viewpoint.street == street]

    @cached_property
    def street_charts(self) -> np.ndarray:
        """Pairs of street and chart, (k, 2) int64, sorted: what the viewpoints of each street show."""
        return np.unique(np.column_stack([self.street_of_views(), self.views[:, 1]]), axis=0)

    def street_of_views(self) -> np.ndarray:
        """The street of every row of views, (k,) int64."""
        return np.array([v.street for v in self.viewpoints], np.int64)[self.views[:, 0]]

    def texels(self) -> np.ndarray:
        """Texels of every chart, (charts,) int64."""
        return self.scene.placement.width.astype(np.int64) * self.scene.placement.height

    def own_pictures(self) -> dict[int, list[int]]:
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
        texels = self.texels()
        total = np.zeros((len(self.wave), 2), np.int64)
        np.add.at(total, seen[:, 0], np.column_stack([texels, texels * self.writable])[seen[:, 1]])
        return total


def ingest(
    buildings: Sequence[Building],
    streets: Sequence[Street],
    *,
    elevation: Elevation | None = None,
    poses: Sequence[Pose] = (),
    panorama_sizes: Sequence[tuple[int, int]] = (),
    texels_per_metre: float,
    spacing: float,
    height: float,
    visibility_range: float,
    panorama_width: int,
    storey: float,
    walls: str,
    page: int = 2048,
    last: Places | None = None,
) -> Plan:
    """Charts and mesh, their place in the atlas, facades, viewpoints and the waves of streets.

    Without streets they are derived from the gaps between the buildings. Without an elevation the ground follows the
    buildings' bases. poses and panorama_sizes (rows, columns) are those of the panoramas. Lengths in metres; walls is
    "exemplar" (facades are seeded, the street stage writes the rest) or "translate" (the street stage writes every chart).
    With the places of an earlier ingest, charts stay where they are in the atlas. Raises GeometryError for a block without
    geometry.
    """
    footprints = [building.footprint for building in buildings]
    streets = tuple(streets) or streets_between(footprints)
    terrain = terrain_of(buildings, elevation)
    one_page = AtlasSpec(1, texels_per_metre, page=page)
    charts, mesh, refused = block_surfaces(
        buildings, streets, terrain=terrain, ground_margin=visibility_range, largest=one_page.largest
    )
    names = tuple(building.id for building in buildings)
    ids = chart_ids(charts, names)
    placement = pack(
        charts.texels(texels_per_metre),
        charts.building,
        page=page,
        chunk=one_page.chunk,
        gutter=one_page.gutter,
        ids=ids,
        last=last,
    )
    spec = AtlasSpec(placement.pages, texels_per_metre, page=page)
    scene = Scene(mesh, charts, placement, spec, spacing=spacing, visibility_range=visibility_range, names=names)

    obstacles = shapely.STRtree(footprints)
    cameras: list[Viewpoint] = []
    for index, street in enumerate(streets):
        positions, forward = viewpoints(
            street.line, spacing=spacing, height=height, obstacles=obstacles, ground=terrain.height
        )
        for position, ahead in zip(positions, forward, strict=True):
            cameras.append(Viewpoint(len(cameras), index, position, ahead))

    seen, looks = look_around(scene, things_of(charts, mesh, names), ids, cameras, streets, panorama_width)
    views = np.array(
        [(camera.id, chart) for camera, row in zip(cameras, seen, strict=True) for chart in row], np.int32
    ).reshape(-1, 2)
    facades = find_facades(scene, buildings, cameras, seen, len(streets), storey)
    on_ground = tuple(
        replace(pose, z=float(terrain.height(np.array([[pose.x, pose.y]]))[0]) + height) if pose.z is None else pose
        for pose in poses
    )
    textured = np.zeros(len(charts), bool)
    textured[mesh.chart[mesh.texture >= 0]] = True
    writable = np.ones(len(charts), bool)
    if walls == "exemplar":
        writable[facades.chart] = False
        writable[textured] = False
    return Plan(
        scene=scene,
        streets=streets,
        facades=facades,
        poses=on_ground,
        refused=refused,
        sightings=_sightings(scene, facades, on_ground, panorama_sizes),
        textured=textured,
        viewpoints=tuple(cameras),
        views=views,
        writable=writable,
        wave=_waves(scene, cameras, seen, writable, len(streets)),
        ids=ids,
        looks=looks,
    )


def _sightings(scene: Scene, facades: Facades, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]]) -> Sightings:
    found = [
        (facade, sighting.panorama, sighting.seen, sighting.pixels_per_metre)
        for facade, chart in enumerate(facades.chart.tolist() if poses else [])
        for sighting in sightings(scene, chart, poses, sizes)
    ]
    columns = list(zip(*found, strict=True)) or [(), (), (), ()]
    return Sightings(
        np.array(columns[0], np.int32),
        np.array(columns[1], np.int32),
        np.array(columns[2], np.float64),
        np.array(columns[3], np.float64),
    )


def _waves(
    scene: Scene, cameras: Sequence[Viewpoint], seen: Sequence[np.ndarray], writable: np.ndarray, streets: int
) -> np.ndarray:
    """The conflict graph of streets by shared chunks, coloured into waves."""
    chunks: dict[int, frozenset] = {}
    reads: list[set] = [set() for _ in range(streets)]
    writes: list[set] = [set() for _ in range(streets)]
    for camera, row in zip(cameras, seen, strict=True):
        for chart in row.tolist():
            if chart not in chunks:
                cells = scene.placement.chunks(chart, scene.spec.chunk, scene.spec.gutter)
                chunks[chart] = frozenset(map(tuple, cells.tolist()))
            reads[camera.street] |= chunks[chart]
            if writable[chart]:
                writes[camera.street] |= chunks[chart]
    return colour_waves(reads, writes)
