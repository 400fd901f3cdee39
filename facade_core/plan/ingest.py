"""Ingest: construction of a block's plan from buildings and streets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from facade_core.core.arrays import BoolArray, Float64Array, UInt64Array
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.types import Building, ElevationRaster, IngestSettings, MappedGround, Pose, Street
from facade_core.geometry.block_surfaces import build_block_surfaces
from facade_core.geometry.buildings.passages import footprint_without_headroom
from facade_core.geometry.chart_packing import PreviousChartPlacements, pack_charts
from facade_core.geometry.ground.carriageways import fit_ground_between_buildings
from facade_core.geometry.ground.objects import place_objects
from facade_core.geometry.ground.street_gaps import derive_streets
from facade_core.geometry.ground.terrain import Terrain, build_terrain
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint, place_viewpoints
from facade_core.geometry.texel_density import min_texel_density, texel_density
from facade_core.geometry.walls import free_wall_shares
from facade_core.plan.core_region import (
    CoreRegion,
    core_chart_mask,
    core_facades,
    core_viewpoints,
    restrict_to_core_streets,
)
from facade_core.plan.facades import find_facades
from facade_core.plan.identity import (
    ParallelMap,
    build_scene_objects,
    chart_ids,
    compute_view_digests,
    map_in_this_process,
)
from facade_core.plan.plan import FacadeSightings, Plan
from facade_core.plan.posed_pictures import replace_panoramas
from facade_core.plan.settings import HEADROOM
from facade_core.plan.surroundings import build_surroundings


@dataclass(frozen=True)
class BlockInputs:
    """Geometry and panoramas of a block that its plan is built from.

    Attributes
    ----------
    buildings : buildings of the block.
    streets : centrelines; without any they are derived from the gaps between the buildings.
    floor_height : metres, where the levels of a building are not tagged.
    ground : mapped ground; None assumes carriageways along the streets.
    elevation : ground heights; None follows the bases of the buildings.
    neighbours : buildings around the block, which views show.
    poses, panorama_sizes : poses and (rows, columns) of the panoramas.
    """

    buildings: Sequence[Building]
    streets: Sequence[Street]
    floor_height: float
    ground: MappedGround | None = None
    elevation: ElevationRaster | None = None
    poses: Sequence[Pose] = ()
    panorama_sizes: Sequence[tuple[int, int]] = ()
    neighbours: Sequence[Building] = ()


@dataclass(frozen=True)
class SceneLayout:
    """Scene of a block before any ray is cast.

    Attributes
    ----------
    scene : charts, mesh and places in the atlas.
    streets : centrelines, given or derived.
    ground : ground fitted between the buildings.
    terrain : ground heights.
    viewpoints : viewpoints that a part of a city needs, or all.
    ids : (charts,) chart ids.
    free_share : (charts,) share of each chart without a neighbour against it.
    in_core : (charts,) charts that are textured.
    rejected_buildings : buildings without usable surfaces as (id, reason).
    """

    scene: Scene
    streets: tuple[Street, ...]
    ground: MappedGround
    terrain: Terrain
    viewpoints: list[Viewpoint]
    ids: UInt64Array
    free_share: Float64Array
    in_core: BoolArray
    rejected_buildings: tuple[tuple[str, str], ...]


def build_scene_layout(
    inputs: BlockInputs,
    settings: IngestSettings,
    *,
    previous: PreviousChartPlacements | None = None,
    core: CoreRegion | None = None,
) -> SceneLayout:
    """Build the charts and viewpoints of a block and place the charts in the atlas; parameters as of `build_plan`."""
    buildings = inputs.buildings
    footprints = [building.footprint for building in buildings]
    streets = tuple(inputs.streets) or derive_streets(footprints)
    ground = fit_ground_between_buildings(inputs.ground or MappedGround(), streets, footprints)
    terrain = build_terrain(buildings, inputs.elevation)
    one_page = AtlasSpec(1, settings.texels_per_metre)
    charts, mesh, refused = build_block_surfaces(
        buildings,
        streets,
        terrain=terrain,
        ground_margin=settings.visibility_range,
        largest=one_page.max_chart_side,
        within=ground.outline,
    )
    names = tuple(building.id for building in buildings)
    finishes = tuple(building.finish for building in buildings)
    headroom = settings.viewpoint_height + HEADROOM.min_headroom_m
    obstacles = [footprint_without_headroom(building, terrain, headroom) for building in buildings]
    cameras = _place_cameras(
        streets, obstacles, terrain, spacing=settings.viewpoint_spacing, height=settings.viewpoint_height
    )
    owned = np.ones(len(charts), bool)
    if core is not None:
        owned = core_chart_mask(charts, buildings, streets, core)
        cameras = core_viewpoints(cameras, streets, buildings, core, settings.visibility_range)
    places = np.array([camera.position for camera in cameras]).reshape(-1, 3)
    free = free_wall_shares(charts, mesh)
    density = texel_density(charts, free, places, settings.texels_per_metre)
    density[~owned] = min_texel_density(settings.texels_per_metre)
    ids = chart_ids(charts, density / settings.texels_per_metre, names, finishes)
    placement = pack_charts(
        charts.size,
        density,
        charts.building,
        page=one_page.page,
        chunk=one_page.chunk,
        gutter=one_page.gutter,
        ids=ids,
        previous=previous,
    )
    spec = replace(one_page, pages=placement.pages)
    scene = Scene(
        mesh,
        charts,
        placement,
        spec,
        spacing=settings.viewpoint_spacing,
        visibility_range=settings.visibility_range,
        names=names,
        finishes=finishes,
    )
    return SceneLayout(scene, streets, ground, terrain, cameras, ids, free, owned, refused)


def build_plan(
    inputs: BlockInputs,
    settings: IngestSettings,
    *,
    previous: PreviousChartPlacements | None = None,
    parallel_map: ParallelMap = map_in_this_process,
    core: CoreRegion | None = None,
) -> Plan:
    """Build the plan of a block: charts, mesh, atlas places, facades and viewpoints.

    Parameters
    ----------
    inputs : geometry and panoramas of the block.
    settings : settings of the block.
    previous : earlier placement; known charts keep their places in the atlas.
    parallel_map : runs the ray casts, which are most of the work.
    core : part that is textured; the halo gets the lowest density. None textures everything.

    Raises
    ------
    GeometryError
        Where the block has no geometry.
    """
    layout = build_scene_layout(inputs, settings, previous=previous, core=core)
    return complete_plan(layout, inputs, settings, previous=previous, parallel_map=parallel_map, core=core)


def complete_plan(
    layout: SceneLayout,
    inputs: BlockInputs,
    settings: IngestSettings,
    *,
    previous: PreviousChartPlacements | None = None,
    parallel_map: ParallelMap = map_in_this_process,
    core: CoreRegion | None = None,
) -> Plan:
    """Complete the plan of a scene: facades, views and sightings; parameters as of `build_plan`."""
    scene, streets, ground, cameras = layout.scene, layout.streets, layout.ground, layout.viewpoints
    buildings, charts, mesh, ids, owned = inputs.buildings, scene.charts, scene.mesh, layout.ids, layout.in_core
    around = streets if settings.walls == "exemplar" else ()
    looks = compute_view_digests(
        scene,
        build_scene_objects(charts, mesh, scene.names),
        ids,
        cameras,
        ground,
        settings.panorama_width,
        parallel_map,
    )
    facades = find_facades(scene, buildings, cameras, looks.charts, inputs.floor_height, layout.free_share, around)
    rows = list(range(len(cameras)))
    if core is not None:
        facades = core_facades(facades, buildings, core)
        streets, rows, cameras, facades = restrict_to_core_streets(streets, cameras, facades, core)
    seen = [looks.charts[row] for row in rows]
    views = np.array(
        [(camera.id, chart) for camera, row in zip(cameras, seen, strict=True) for chart in row], np.int32
    ).reshape(-1, 2)
    footprints = [building.footprint for building in buildings]
    walled = [*footprints, *(one.footprint for one in inputs.neighbours if not one.raised)]
    textured = np.zeros(len(charts), bool)
    textured[mesh.chart[mesh.texture >= 0]] = True
    textured &= owned
    writable = owned.copy()
    if settings.walls == "exemplar":
        writable[facades.chart] = False
        writable[textured] = False
    plan = Plan(
        scene=scene,
        streets=streets,
        ground=ground,
        facades=facades,
        poses=(),
        rejected_buildings=layout.rejected_buildings,
        sightings=FacadeSightings.empty(),
        textured=textured,
        viewpoints=tuple(cameras),
        views=views,
        writable=writable,
        ids=ids,
        view_digests=tuple(looks.digests[row] for row in rows),
        in_core=owned,
        street_density=scene.placement.texels_per_metre,
        objects=place_objects(ground, walled, charts, mesh, owned),
        surroundings=build_surroundings(inputs.neighbours, ground, (charts, mesh), footprints, layout.terrain),
    )
    poses = fill_pose_heights(inputs.poses, layout.terrain, settings.viewpoint_height)
    return replace_panoramas(plan, poses, inputs.panorama_sizes, previous)


def _place_cameras(
    streets: Sequence[Street],
    footprints: Sequence[Polygon | MultiPolygon],
    terrain: Terrain,
    *,
    spacing: float,
    height: float,
) -> list[Viewpoint]:
    """Place viewpoints along all streets, outside of the footprints."""
    obstacles = shapely.STRtree(footprints)
    cameras: list[Viewpoint] = []
    for index, street in enumerate(streets):
        positions, forward = place_viewpoints(
            street.line, spacing=spacing, height=height, obstacles=obstacles, ground=terrain.interpolate
        )
        for position, ahead in zip(positions, forward, strict=True):
            cameras.append(Viewpoint(len(cameras), index, position, ahead))
    return cameras


def fill_pose_heights(poses: Sequence[Pose], terrain: Terrain, height: float) -> tuple[Pose, ...]:
    """Return poses with unknown heights set to `height` metres above the terrain."""
    return tuple(
        replace(pose, z=float(terrain.interpolate(np.array([[pose.x, pose.y]]))[0]) + height)
        if pose.z is None
        else pose
        for pose in poses
    )
