"""Ingest: buildings and streets into everything the later stages need to know about a block's geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, Elevation, Ground, Pose, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.chart_packing import PreviousPlacement, pack_charts
from facade_core.geometry.ground.carriageways import fit_ground
from facade_core.geometry.ground.street_gaps import derive_streets
from facade_core.geometry.ground.terrain import Terrain, build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint, assign_waves, place_viewpoints
from facade_core.geometry.texel_density import min_texel_density, texel_density
from facade_core.geometry.walls import WallRole, free_wall_shares
from facade_core.imagery.poses.panorama_camera import WALL_REACH_M
from facade_core.imagery.rectify.panorama import MAX_SIGHTING_DISTANCE_M, find_sightings, nearby_panoramas
from facade_core.plan.core_region import CoreRegion, core_charts, core_facades, core_streets, core_viewpoints
from facade_core.plan.facades import Facades, find_facades
from facade_core.plan.identity import ParallelMap, build_scene_objects, chart_ids, compute_view_digests, map_in_process
from facade_core.plan.plan import Plan, Sightings

# Share of a facade off the streets that a panorama must show to texture it.
MIN_OFF_STREET_SHARE = 0.3


def ingest(
    buildings: Sequence[Building],
    streets: Sequence[Street],
    *,
    ground: Ground | None = None,
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
    last: PreviousPlacement | None = None,
    each: ParallelMap = map_in_process,
    own: CoreRegion | None = None,
) -> Plan:
    """Charts and mesh, their place in the atlas, facades, viewpoints and the waves of streets.

    ground: what a map says of it; of streets only the lines are known without. Without streets they are derived from the gaps
    between the buildings. Without an elevation the ground follows the buildings' bases. poses and panorama_sizes (rows,
    columns) are those of the panoramas. texels_per_metre is the density near streets. Lengths in metres; walls is "exemplar"
    (facades are seeded, the street stage writes the rest) or "translate" (the street stage writes every chart). With the
    places of an earlier ingest, charts stay where they are in the atlas. `each` says where rays are cast, most of the work.
    own: what is textured, where the block is a part of a city; the rest is only seen, at the lowest density.
    Raises GeometryError for a block without geometry.
    """
    footprints = [building.footprint for building in buildings]
    streets = tuple(streets) or derive_streets(footprints)
    ground = fit_ground(ground or Ground(), streets, footprints)
    terrain = build_terrain(buildings, elevation)
    one_page = AtlasSpec(1, texels_per_metre, page=page)
    charts, mesh, refused = build_block_surfaces(
        buildings,
        streets,
        terrain=terrain,
        ground_margin=visibility_range,
        largest=one_page.max_chart_side,
        within=ground.outline,
    )
    names = tuple(building.id for building in buildings)
    finishes = tuple(building.finish for building in buildings)
    cameras = _place_cameras(streets, footprints, terrain, spacing=spacing, height=height)
    owned = np.ones(len(charts), bool)
    if own is not None:
        owned = core_charts(charts, buildings, streets, own)
        cameras = core_viewpoints(cameras, streets, buildings, own, visibility_range)
    places = np.array([camera.position for camera in cameras]).reshape(-1, 3)
    free = free_wall_shares(charts, mesh)
    density = texel_density(charts, free, places, texels_per_metre)
    density[~owned] = min_texel_density(texels_per_metre)
    ids = chart_ids(charts, density / texels_per_metre, names, finishes)
    placement = pack_charts(
        charts.size,
        density,
        charts.building,
        page=page,
        chunk=one_page.chunk,
        gutter=one_page.gutter,
        ids=ids,
        last=last,
    )
    spec = AtlasSpec(placement.pages, texels_per_metre, page=page)
    scene = Scene(
        mesh,
        charts,
        placement,
        spec,
        spacing=spacing,
        visibility_range=visibility_range,
        names=names,
        finishes=finishes,
    )

    seen, looks = compute_view_digests(
        scene, build_scene_objects(charts, mesh, names), ids, cameras, ground, panorama_width, each
    )
    around = streets if walls == "exemplar" else ()
    facades = find_facades(scene, buildings, cameras, seen, storey, free, around)
    if own is not None:
        facades = core_facades(facades, buildings, own)
        streets, rows, cameras, facades = core_streets(streets, cameras, facades, own)
        seen, looks = [seen[row] for row in rows], tuple(looks[row] for row in rows)
    views = np.array(
        [(camera.id, chart) for camera, row in zip(cameras, seen, strict=True) for chart in row], np.int32
    ).reshape(-1, 2)
    textured = np.zeros(len(charts), bool)
    textured[mesh.chart[mesh.texture >= 0]] = True
    textured &= owned
    writable = owned.copy()
    if walls == "exemplar":
        writable[facades.chart] = False
        writable[textured] = False
    plan = Plan(
        scene=scene,
        streets=streets,
        ground=ground,
        facades=facades,
        poses=(),
        rejected_buildings=refused,
        sightings=_find_sightings(scene, facades, (), ()),
        textured=textured,
        viewpoints=tuple(cameras),
        views=views,
        writable=writable,
        wave=_street_waves(scene, cameras, seen, writable, len(streets)),
        ids=ids,
        view_digests=looks,
        in_core=owned,
    )
    return replace_panoramas(plan, place_poses(poses, terrain, height), panorama_sizes)


def _place_cameras(
    streets: Sequence[Street], footprints: Sequence[shapely.Polygon], terrain: Terrain, *, spacing: float, height: float
) -> list[Viewpoint]:
    """The viewpoints along all streets."""
    obstacles = shapely.STRtree(footprints)
    cameras: list[Viewpoint] = []
    for index, street in enumerate(streets):
        positions, forward = place_viewpoints(
            street.line, spacing=spacing, height=height, obstacles=obstacles, ground=terrain.interpolate
        )
        for position, ahead in zip(positions, forward, strict=True):
            cameras.append(Viewpoint(len(cameras), index, position, ahead))
    return cameras


def place_poses(poses: Sequence[Pose], terrain: Terrain, height: float) -> tuple[Pose, ...]:
    """Poses, those without a height of their own `height` metres above the terrain."""
    return tuple(
        replace(pose, z=float(terrain.interpolate(np.array([[pose.x, pose.y]]))[0]) + height)
        if pose.z is None
        else pose
        for pose in poses
    )


def replace_panoramas(plan: Plan, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]]) -> Plan:
    """The plan of the same geometry with panoramas of these poses, on the ground, and sizes (rows, columns)."""
    return replace(plan, poses=tuple(poses), sightings=_find_sightings(plan.scene, plan.facades, poses, sizes))


def _find_sightings(
    scene: Scene, facades: Facades, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]]
) -> Sightings:
    found = []
    for index, near in enumerate(nearby_panoramas(scene, facades.chart, poses)):
        chart, of = int(facades.chart[index]), near.tolist()
        on_street = facades.role[index] == WallRole.STREET
        reach, least = (MAX_SIGHTING_DISTANCE_M, 0.0) if on_street else (WALL_REACH_M, MIN_OFF_STREET_SHARE)
        for sighting in find_sightings(scene, chart, [poses[i] for i in of], [sizes[i] for i in of], max_distance=reach):
            if sighting.seen_share >= least:
                found.append((index, of[sighting.panorama], sighting.seen_share, sighting.pixels_per_metre))
    columns = list(zip(*found, strict=True)) or [(), (), (), ()]
    return Sightings(
        np.array(columns[0], np.int32),
        np.array(columns[1], np.int32),
        np.array(columns[2], np.float64),
        np.array(columns[3], np.float64),
    )


def _street_waves(
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
    return assign_waves(reads, writes)
