"""Stage `bundles`: refine panoramas that show the same walls together, after each was refined alone."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from pathlib import Path

import numpy as np
import shapely

from catalogs.block.reader import Block
from catalogs.readers.pictures.source_poses import parse_iso_date
from facade_core.atlas.journal import read_journal
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.charts import CORNER_SHARES
from facade_core.geometry.walls import WallRole
from facade_core.imagery.panorama_camera import GROUND_REACH_M
from facade_core.imagery.poses.bundles import group_panoramas_into_bundles
from facade_core.imagery.poses.joint_refinement import PriorPose
from facade_core.imagery.poses.settings import JOINT, PANORAMA_BUNDLES
from facade_core.plan.plan import FacadeSightings, Plan
from tasks.engine.inputs import PANORAMAS_CHANGED
from tasks.engine.run import Run
from tasks.engine.stage import ForecastInputs, Pending, Stage, UnitOutline
from tasks.engine.unit import Unit
from tasks.stages.bundles.refined_poses import pose_from_record
from tasks.stages.bundles.worker import BundleInputs, BundlePanorama, bundle_record_fields, compute_bundle
from tasks.stages.poses.record import PoseRecord
from tasks.stages.poses.stage import pose_memory
from tasks.stages.shared.memory import LIBRARY_BYTES
from tasks.stages.shared.picture_choice import choose_pictures
from tasks.stages.shared.scene_view import SceneView, view_charts
from tasks.stages.shared.view_inputs import POSE_SURROUNDINGS_M

# Bytes kept of each panorama of a bundle.
SMALL_PANORAMA_BYTES = JOINT.max_turn_pixels * JOINT.max_turn_pixels // 2 * 3


def list_bundle_units(run: Run, block: Block, plan: Plan, group: StoreGroup) -> list[Unit[BundleInputs]]:
    """List the units of stage `bundles`: one for each bundle, without rejected panoramas."""
    records = read_journal(group, "poses", PoseRecord)
    units = []
    for index, (name, bundle) in enumerate(zip(bundle_names(plan, block), panorama_bundles(plan, block), strict=True)):
        members = tuple(
            BundlePanorama(block.panoramas[i].path, plan.poses[i], _panorama_estimate(record, plan, i))
            for i in bundle
            if (record := records[i]) is not None and record["status"] == "done" and not record.get("is_unused")
        )
        inputs = bundle_inputs(run, plan, members, _bundle_charts(plan, bundle))
        units.append(Unit(index, name, inputs, bundle_memory([one.path for one in members])))
    return units


def panorama_bundles(plan: Plan, block: Block) -> list[tuple[int, ...]]:
    """Return the panoramas that are refined together, of those that surfaces are taken from, by the given poses."""
    days = [_day_number(parse_iso_date(panorama.captured)) for panorama in block.panoramas]
    places = np.array([(pose.x, pose.y) for pose in plan.poses]).reshape(-1, 2)
    seen = _street_sightings(plan)
    used = np.isin(seen.panorama, list(choose_pictures(plan, block)))
    return group_panoramas_into_bundles(seen.facade[used], seen.panorama[used], seen.seen[used], places, days)


def bundle_members(plan: Plan, block: Block, some: Sequence[int]) -> set[int]:
    """Return the panoramas of some bundles."""
    return {panorama for number in some for panorama in panorama_bundles(plan, block)[number]}


def bundle_names(plan: Plan, block: Block) -> list[str]:
    """Return the names of bundles: that of their first panorama."""
    return [block.panoramas[bundle[0]].path.name for bundle in panorama_bundles(plan, block)]


def _street_sightings(plan: Plan) -> FacadeSightings:
    """Return the sightings of facades on streets."""
    seen = plan.sightings
    kept = plan.facades.role[seen.facade] == WallRole.STREET
    return FacadeSightings(seen.facade[kept], seen.panorama[kept], seen.seen[kept], seen.pixels_per_metre[kept])


def _panorama_estimate(record: PoseRecord, plan: Plan, panorama: int) -> PriorPose:
    """Return the pose of a panorama refined alone."""
    spread = record.get("spread")  # a journal from before it was kept has none
    return PriorPose(pose_from_record(plan.poses[panorama], record), None if spread is None else np.array(spread))


def _bundle_charts(plan: Plan, bundle: Sequence[int]) -> tuple[int, ...]:
    """Return the charts of facades that two panoramas of a bundle show, and of ground near two of them, ascending."""
    seen = _street_sightings(plan)
    shown = seen.facade[np.isin(seen.panorama, bundle) & (seen.seen >= PANORAMA_BUNDLES.min_wall_share)]
    facade, count = np.unique(shown, return_counts=True)
    ground = plan.ground_near_cameras()
    corners = plan.scene.charts.points_at_shares(ground, CORNER_SHARES)[..., :2]
    boxes = shapely.box(*corners.min(axis=1).T, *corners.max(axis=1).T)
    places = shapely.points([(plan.poses[i].x, plan.poses[i].y) for i in bundle])
    near = (shapely.distance(boxes[:, None], places) <= GROUND_REACH_M).sum(axis=1) > 1
    return tuple(np.sort(np.concatenate([plan.facades.chart[facade[count > 1]], ground[near]])).tolist())


def _day_number(day: str | None) -> int | None:
    return date.fromisoformat(day).toordinal() if day else None


def bundle_inputs(run: Run, plan: Plan, members: tuple[BundlePanorama, ...], charts: Sequence[int]) -> BundleInputs:
    """Return the inputs of panoramas that are refined together on some charts."""
    return BundleInputs(members, view_charts(run, plan, charts), _view_around(run, plan, members))


def _view_around(run: Run, plan: Plan, members: Sequence[BundlePanorama]) -> SceneView:
    """Return a view of what panoramas may be matched with."""
    places = np.array([(one.alone.pose.x, one.alone.pose.y, one.alone.pose.z) for one in members]).reshape(-1, 3)
    if not len(places):
        return SceneView(run, (), ())
    low, high = places.min(axis=0) - POSE_SURROUNDINGS_M, places.max(axis=0) + POSE_SURROUNDINGS_M
    return SceneView(run, (), tuple(plan.scene_objects.digests_in_box(low, high)))


def bundle_memory(paths: Sequence[Path]) -> int:
    """Return the memory of panoramas that are refined together: each is read in turn and kept small."""
    widest = max((pose_memory(path) for path in paths), default=LIBRARY_BYTES)
    return widest + len(paths) * SMALL_PANORAMA_BYTES


def _forecast(inputs: ForecastInputs, own: Pending) -> Pending:
    """Find the pending bundles, with those of panoramas that are refined again."""
    again = inputs.pending["poses"].keys()
    following = (
        number for number, bundle in enumerate(panorama_bundles(inputs.plan, inputs.block)) if again & set(bundle)
    )
    return dict.fromkeys(following, PANORAMAS_CHANGED) | dict(own)


BUNDLES = Stage(
    "bundles",
    "panorama bundle",
    outline=lambda block, plan: [UnitOutline(name) for name in bundle_names(plan, block)],
    inputs=list_bundle_units,
    compute=compute_bundle,
    write=bundle_record_fields,
    forecast=_forecast,
)
