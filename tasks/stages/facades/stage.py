"""Stage `facades`: units, imagery and exemplars of facades; those of one building are processed in one go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import shapely

from catalogs.block.corrections import BUILDING_CORRECTION_KINDS
from catalogs.block.part import MAX_ENTRANCE_DISTANCE_M
from catalogs.block.reader import Block
from catalogs.readers.pictures.folders import find_facade_photo
from facade_core.core.types import AS_FOUND, SHIPPED_MODELS, Pose, TrainedModelFiles
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.settings import FACADE_WALLS
from facade_core.imagery.cameras.exposure import estimate_common_exposure
from facade_core.plan.doors import has_back_door, is_corner_facade
from facade_core.plan.plan import Plan
from tasks.engine.inputs import digest_inputs, join_key
from tasks.engine.run import Run
from tasks.engine.seeds import BUILDING_SEED, FACADE_SEED, unit_seed
from tasks.engine.stage import Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.bundles.nearby_panoramas import ground_squares
from tasks.stages.bundles.refined_poses import is_rejected_panorama, pose_from_record, read_bundled_pose_records
from tasks.stages.facades.exemplar_choices import (
    FOOT_CORNERS,
    choose_facade_exemplars,
    store_exemplar_choices,
)
from tasks.stages.facades.forecast import forecast_pending_facades
from tasks.stages.facades.imagery import FacadeImagery, FacadeInputs, iterate_sources
from tasks.stages.facades.worker import process_facades
from tasks.stages.shared.captures import facade_panoramas_by_capture
from tasks.stages.shared.facade_corrections import match_corrections
from tasks.stages.shared.memory import (
    FACADE_TEXEL,
    LIBRARY_BYTES,
    PICTURE_PIXEL,
    bounded_pixel_count,
    detector_memory,
    given_network_memory,
    peak_decoding_bytes,
)
from tasks.stages.shared.scene_view import SceneView, view_charts
from tasks.stages.shared.view_inputs import bounding_box, object_digests_between, textures_of_charts, view_own_textures


def list_facade_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[FacadeInputs]]:
    """List the units of stage `facades`, by refined poses and prepared exemplars."""
    imagery = select_imagery_per_facade(run, block, plan, group)
    inputs = [facade_inputs(run, plan, index, pictures, block.textures) for index, pictures in enumerate(imagery)]
    charts, texels = plan.facades.chart.tolist(), plan.texel_counts()
    keys = [pictures_key(one) for one in inputs]
    together, buildings = _first_buildings(plan), plan.facades.building.tolist()
    corrected = block.corrections.select_kinds(BUILDING_CORRECTION_KINDS)
    units = []
    for index, (one, beside) in enumerate(zip(inputs, _pictured_neighbours(plan, imagery), strict=True)):
        house = replace(
            one,
            exposed_with=tuple(keys[other] for other in beside if inputs[other].is_photographed),
            coloured_by=tuple(keys[other] for other in beside),
            beside=beside,
        )
        memory = facade_memory(int(texels[charts[index]]), one, one.models)
        is_corrected = one.corrected != AS_FOUND or plan.scene.names[buildings[index]] in corrected
        units.append(
            Unit(index, plan.facades.id[index], house, memory, (charts[index],), together[index], is_corrected)
        )
    return units


def facade_inputs(run: Run, plan: Plan, facade: int, imagery: FacadeImagery, textures: Sequence[Path]) -> FacadeInputs:
    """Return the inputs of a facade, without the others of its building.

    Parameters
    ----------
    facade : index of the facade.
    imagery : its pictures.
    textures : files of the model's textures.
    """
    table, placement = plan.facades, plan.scene.placement
    chart = int(table.chart[facade])
    shape = (int(placement.width[chart]), int(placement.height[chart]))
    size = (float(table.width[facade]), float(table.height[facade]), int(table.floors[facade]))
    position = (float(table.along[facade]), int(table.role[facade]), float(plan.street_density[chart]))
    joint = FACADE_WALLS.max_joint_m
    low, high = bounding_box(plan, table.chart[table.run_members(facade)].tolist())
    house = (
        float(table.foot[facade]),
        float(table.eaves[facade]),
        int(table.storeys[facade]),
        bool(table.raised[facade]),
        bool(table.roofed[facade]),
        is_corner_facade(plan.scene.charts, table, facade),
        has_back_door(table, facade),
    )
    poses = [pose for _, pose in (*imagery.panoramas, *imagery.earlier)]
    return FacadeInputs(
        **{one.name: getattr(imagery, one.name) for one in fields(FacadeImagery)},
        own=view_own_textures(run, plan, [chart], textures) if imagery.textured else None,
        view=view_charts(run, plan, [chart], table.id[facade], shape, size, position),
        between=SceneView(run, (chart,), tuple(tuple(object_digests_between(plan, [chart], pose)) for pose in poses)),
        house_view=SceneView(run, (chart,), (*house, *plan.scene_objects.digests_in_box(low - joint, high + joint))),
        models=run.models,
        walls=run.texture.walls,
        privacy=run.privacy,
        seed=unit_seed(run, table.id[facade], FACADE_SEED),
        wall_seed=unit_seed(run, table.id[int(table.run[facade])], FACADE_SEED),
        building_seed=unit_seed(run, str(table.house[facade]), BUILDING_SEED),
        texture_files=textures_of_charts(plan, [chart], textures) if imagery.textured else {},
    )


def pictures_key(inputs: FacadeInputs) -> str:
    """Return the key of a facade as its pictures give it, by which the others of its building follow it."""
    exemplar = {"exemplar", "is_exemplar_stated", "house_view", "walls", "wall_seed", "building_seed"}
    return join_key({name: digest for name, digest in digest_inputs(inputs).items() if name not in exemplar})


def _first_buildings(plan: Plan) -> list[int]:
    """Return for each facade the first building part of its building: all parts may share the colour of one wall."""
    first: dict[int, int] = {}
    houses, buildings = plan.facades.house.tolist(), plan.facades.building.tolist()
    for house, building in zip(houses, buildings, strict=True):
        first[house] = min(building, first.get(house, building))
    return [first[house] for house in houses]


def _pictured_neighbours(plan: Plan, imagery: Sequence[FacadeImagery]) -> list[tuple[int, ...]]:
    """Return for each facade the other facades of its building that have pictures or textures of the model."""
    pictured: dict[int, list[int]] = {}
    houses = plan.facades.house.tolist()
    for facade, (house, pictures) in enumerate(zip(houses, imagery, strict=True)):
        if next(iterate_sources(pictures), None) is not None:
            pictured.setdefault(house, []).append(facade)
    return [tuple(other for other in pictured.get(house, ()) if other != facade) for facade, house in enumerate(houses)]


def select_imagery_per_facade(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[FacadeImagery]:
    """Return the pictures and the chosen exemplar of every facade."""
    captures = facade_panoramas_by_capture(plan, block)
    poses = read_bundled_pose_records(group)
    exposure = estimate_common_exposure([ground_squares(pose) for pose in poses])
    factors = {
        panorama.path: tuple(factor)
        for panorama, factor, shared in zip(
            block.panoramas, exposure.factors.tolist(), exposure.is_shared.tolist(), strict=True
        )
        if shared
    }
    days = {panorama.path: panorama.captured for panorama in block.panoramas if panorama.captured}
    exemplars, stated = choose_facade_exemplars(run, block, plan, group)
    entrances = facade_entrance_positions(plan, block.entrances)
    corrections, _ = match_corrections(plan, block.corrections, block.crs)
    textured = plan.textured[plan.facades.chart].tolist()

    def panorama_poses(panoramas: Sequence[int]) -> tuple[tuple[Path, Pose], ...]:
        return tuple(
            (block.panoramas[p].path, pose_from_record(plan.poses[p], poses[p]))
            for p in panoramas
            if not is_rejected_panorama(poses[p])
        )

    found = []
    for i, name in enumerate(plan.facades.id):
        newest, earlier = panorama_poses(captures[i].newest), panorama_poses(captures[i].before)
        corrected = corrections.get(i, AS_FOUND)
        found.append(
            FacadeImagery(
                photo=find_facade_photo(block.photos, name),
                rectified=block.photos_rectified,
                panoramas=newest,
                earlier=earlier,
                captured={path: days[path] for path, _ in (*newest, *earlier) if path in days},
                exposure_factors={path: factors[path] for path, _ in (*newest, *earlier) if path in factors},
                textured=bool(textured[i]),
                exemplar=exemplars.get(i) if corrected.facade else None,
                is_exemplar_stated=i in stated,
                corrected=corrected,
                entrances=entrances[i],
            )
        )
    return found


def facade_entrance_positions(plan: Plan, places: Sequence[tuple[float, float]]) -> list[tuple[float, ...]]:
    """Return the positions of mapped entrances along each facade's wall, metres."""
    facades = plan.facades
    found: dict[int, set[float]] = {}
    low = np.flatnonzero((np.abs(facades.foot) < FACADE_WALLS.level_tolerance_m) & ~facades.raised)
    if len(places) and len(low):
        walls = shapely.linestrings(plan.scene.charts.points_at_shares(facades.chart[low], FOOT_CORNERS)[..., :2])
        points = shapely.points(np.array(places).reshape(-1, 2))
        of, wall = shapely.STRtree(walls).query_nearest(points, max_distance=MAX_ENTRANCE_DISTANCE_M, all_matches=False)
        at = shapely.line_locate_point(walls[wall], points[of]) + facades.along[low[wall]]
        for facade, metres in zip(low[wall].tolist(), at.tolist(), strict=True):
            found.setdefault(int(facades.run[facade]), set()).add(round(metres, 2))
    return [tuple(sorted(found.get(run, ()))) for run in facades.run.tolist()]


def facade_memory(texels: int, imagery: FacadeImagery, models: TrainedModelFiles = SHIPPED_MODELS) -> int:
    """Return the bytes that texturing a facade takes at most."""
    panoramas = [path for path, _ in (*imagery.panoramas, *imagery.earlier)]
    tried = ([imagery.photo] if imagery.photo else [], panoramas)  # one after the other
    kept = max(bounded_pixel_count(pictures) for pictures in tried)
    least = LIBRARY_BYTES + (detector_memory() + given_network_memory(models) if kept else 0)
    return least + max(texels * FACADE_TEXEL, *map(peak_decoding_bytes, tried)) + kept * PICTURE_PIXEL


FACADES = Stage(
    "facades",
    "facade",
    outline=lambda block, plan: [
        UnitOutline(name, (chart,)) for name, chart in zip(plan.facades.id, plan.facades.chart.tolist(), strict=True)
    ],
    inputs=list_facade_units,
    process=process_facades,
    prepare=store_exemplar_choices,
    forecast=forecast_pending_facades,
)
