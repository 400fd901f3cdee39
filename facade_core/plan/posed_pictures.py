"""Posed pictures of a plan: the facades that they show, and the density of facades that pictures show sharply."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.types import Pose
from facade_core.geometry.chart_packing import PreviousChartPlacements, pack_charts
from facade_core.geometry.walls import WallRole
from facade_core.imagery.panorama_camera import WALL_REACH_M
from facade_core.imagery.rectify.coverage import order_by_coverage
from facade_core.imagery.rectify.panorama import MAX_SIGHTING_DISTANCE_M, find_sightings, nearby_panoramas
from facade_core.plan.identity import chart_ids
from facade_core.plan.pictured_density import pictured_density
from facade_core.plan.plan import FacadeSightings, Plan
from facade_core.plan.settings import POSED_PICTURES


def replace_panoramas(
    plan: Plan, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]], previous: PreviousChartPlacements | None = None
) -> Plan:
    """Return the plan with these panoramas, and facades at the density that they support.

    Parameters
    ----------
    poses : poses of the panoramas, all with a height.
    sizes : (rows, columns) of the panoramas.
    previous : earlier placement; charts of the same size keep their places in the atlas.
    """
    sightings = _find_sightings(plan, poses, sizes)
    return place_pictured_facades(replace(plan, poses=tuple(poses), sightings=sightings), previous)


def place_pictured_facades(
    plan: Plan, previous: PreviousChartPlacements | None = None, photos: Float64Array | None = None
) -> Plan:
    """Return the plan with facades at the density that their pictures support.

    Parameters
    ----------
    previous : earlier placement; charts of the same size keep their places in the atlas.
    photos : (facades,) pixels per metre of the photo of each facade, 0 without one.
    """
    density = pictured_density(plan, photos)
    scene, spec = plan.scene, plan.scene.spec
    if np.array_equal(density, scene.placement.texels_per_metre):
        return plan
    ids = chart_ids(scene.charts, density / spec.texels_per_metre, scene.names, scene.finishes)
    placement = pack_charts(
        scene.charts.size,
        density,
        scene.charts.building,
        page=spec.page,
        chunk=spec.chunk,
        gutter=spec.gutter,
        ids=ids,
        previous=previous,
    )
    scene = replace(scene, placement=placement, spec=replace(spec, pages=placement.pages))
    return replace(plan, scene=scene, ids=ids)


def _find_sightings(plan: Plan, poses: Sequence[Pose], sizes: Sequence[tuple[int, int]]) -> FacadeSightings:
    scene, facades = plan.scene, plan.facades
    found = []
    for index, near in enumerate(nearby_panoramas(scene, facades.chart, poses)):
        chart, of = int(facades.chart[index]), near.tolist()
        if not of:
            continue
        on_street = facades.role[index] == WallRole.STREET
        reach, least = (
            (MAX_SIGHTING_DISTANCE_M, 0.0) if on_street else (WALL_REACH_M, POSED_PICTURES.min_off_street_share)
        )
        shown = find_sightings(
            scene,
            chart,
            [poses[i] for i in of],
            [sizes[i] for i in of],
            max_distance=reach,
            texels_per_metre=float(plan.street_density[chart]),
        )
        for sighting in order_by_coverage(shown):
            if sighting.seen_share >= least:
                found.append((index, of[sighting.panorama], sighting.seen_share, sighting.pixels_per_metre))
    columns = list(zip(*found, strict=True)) or [(), (), (), ()]
    return FacadeSightings(
        np.array(columns[0], np.int32),
        np.array(columns[1], np.int32),
        np.array(columns[2], np.float64),
        np.array(columns[3], np.float64),
    )
