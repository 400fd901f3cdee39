"""Scenes with panoramas of which one is held out: a painted street with truth, and the real block at the IJ in Amsterdam."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely

from benchmarks.cameras import photographed_street
from benchmarks.painter.street_paint import ground_pattern_painter, side_pattern_painter
from benchmarks.painter.street_truth import (
    SyntheticStreet,
    is_behind_cutout,
    render_street_panorama,
    synthetic_street,
)
from benchmarks.poses import refined_poses
from catalogs.block.reader import read_block
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER
from facade_core.core.lens_projection import picture_rays
from facade_core.core.types import Lens, Pose, Street
from facade_core.geometry.equirectangular import panorama_rays
from facade_core.geometry.scene import Scene
from facade_core.geometry.walls import main_surface_mask
from facade_core.imagery.cameras.occluder_masks import mask_building_occluders
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.poses.bundles import group_panoramas_into_bundles
from facade_core.imagery.rectify.panorama import find_sightings
from tasks.stages.ingest.planning import make_plan
from tasks.stages.shared.images import read_panorama

# Points of rays that meet nothing, metres.
FAR_M = 1000.0
# Lens of the perspective pictures: width of four, height of three, 67 degrees across, a little distorted.
LENS_FOCAL_WIDTHS = 0.75
LENS_DISTORTION = (-0.08, 0.01)
# How far the stated poses of these pictures are off, metres and degrees.
PICTURE_NOISE_M, PICTURE_NOISE_DEG = 0.1, 0.5
# Colour of what a method that only projects has no picture of.
UNSEEN_GREY = 128


@dataclass(frozen=True, eq=False)
class Panorama:
    """Panorama with the pose at which it was taken.

    Attributes
    ----------
    image : (H, W, 3) uint8.
    pose : pose by which figures are measured: true, or refined with all panoramas.
    occluded : (H, W) bool, something the mesh lacks is in front.
    """

    image: np.ndarray
    pose: Pose
    occluded: np.ndarray


@dataclass(frozen=True, eq=False)
class Case:
    """Scene, the panoramas that texture it, and the one that is held out.

    Attributes
    ----------
    scene, streets : geometry.
    facades : charts that a run parses and completes.
    taken : panoramas that texture it.
    poses : poses by which they texture it.
    held_out : panorama that nothing but the comparison reads; on the street without occluders.
    """

    scene: Scene
    streets: tuple[Street, ...]
    facades: tuple[int, ...]
    taken: tuple[Panorama, ...]
    poses: tuple[Pose, ...]
    held_out: Panorama

    @property
    def images(self) -> list[np.ndarray]:
        """Return the pictures that texture the scene."""
        return [one.image for one in self.taken]

    @cached_property
    def other_walls(self) -> frozenset[int]:
        """Return walls and roofs that no facade covers."""
        return frozenset(np.flatnonzero(main_surface_mask(self.scene.charts)).tolist()) - set(self.facades)

    def size(self, chart: int) -> tuple[int, int]:
        """Return height and width of a chart in texels."""
        return self.scene.placement.shape(chart)

    @property
    def texels(self) -> int:
        """Return the texels of all charts."""
        placement = self.scene.placement
        return int((placement.width.astype(np.int64) * placement.height).sum())


def street_cases(*, seed: int, buildings: int, cameras: int, width: int) -> dict[str, list[Case]]:
    """Build a painted street with its middle panorama held out, by whether poses are true or refined.

    Refined poses start 0.3 m and 1 degree off, and nothing but mesh and pictures without the one held out refines them.
    """
    street = synthetic_street(buildings, seed=seed, with_roofs=True)
    ground, sides = ground_pattern_painter(street), side_pattern_painter(street)
    true, given, _, images = photographed_street(street, cameras, width, seed, ground=ground, sides=sides)
    bare = replace(street, cutouts=tuple(np.zeros_like(cutout) for cutout in street.cutouts))
    middle = cameras // 2
    truth = render_street_panorama(bare, true[middle], width, seed=cameras, ground=ground, sides=sides)
    line = Street("street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)]))
    others = [number for number in range(cameras) if number != middle]
    taken = tuple(Panorama(images[n], true[n], _cutouts_in_panorama(street, true[n], width)) for n in others)
    held_out = Panorama(truth, true[middle], np.zeros(truth.shape[:2], bool))
    refined = refined_poses(street.scene, [images[n] for n in others], [given[n] for n in others])["together"]
    return {
        name: [Case(street.scene, (line,), street.charts, taken, tuple(poses), held_out)]
        for name, poses in (("true", [one.pose for one in taken]), ("refined", refined))
    }


def perspective_cases(*, seed: int, buildings: int, pictures: int, width: int) -> dict[str, list[Case]]:
    """Build a painted street with so many perspective pictures of both sides, by whether poses are true, off or refined.

    A panorama from the middle of the street is held out. `off` is PICTURE_NOISE_M and PICTURE_NOISE_DEG; `refined` starts
    there, as a run does it.
    """
    street, case, off = photograph_perspective(seed=seed, buildings=buildings, pictures=pictures, width=width)
    refined = refine_in_bundles(street, case.images, off)
    return {
        name: [replace(case, poses=tuple(poses))]
        for name, poses in (("true", case.poses), ("off", off), ("refined", refined))
    }


def photograph_perspective(
    *, seed: int, buildings: int, pictures: int, width: int, heights: tuple[float, float] = (1.6, 2.6)
) -> tuple[SyntheticStreet, Case, list[Pose]]:
    """Photograph a painted street from heights in metres; returns it, the case with true poses, and poses that are off."""
    street = synthetic_street(buildings, seed=seed, with_roofs=True)
    ground, sides = ground_pattern_painter(street), side_pattern_painter(street)
    lens = Lens((width, width * 3 // 4), (LENS_FOCAL_WIDTHS * width,) * 2, (width / 2, width * 3 / 8), LENS_DISTORTION)
    rng = np.random.default_rng(seed)
    taken, off = [], []
    for number in range(pictures):
        side = 1 if number % 2 else -1
        x, y = street.world_point((number + 0.5) / pictures * street.length, -3.0 * side)
        ahead = street.axis[::-1] * [-1, 1] * side
        heading = float(np.degrees(np.arctan2(*ahead)) + rng.uniform(-35, 35))
        pitch, roll = float(rng.uniform(-6, 14)), float(rng.normal(0, 1))
        pose = Pose(float(x), float(y), float(rng.uniform(*heights)), heading, pitch, roll, lens=lens)
        image = render_street_panorama(
            street, pose, width, gain=float(rng.uniform(0.8, 1.0)), seed=number, ground=ground, sides=sides
        )
        taken.append(Panorama(image, pose, _cutouts_in_panorama(street, pose, width)))
        step, turn = (one / np.linalg.norm(one) for one in rng.normal(0, 1, (2, 3)))
        shift, angles = PICTURE_NOISE_M * step, PICTURE_NOISE_DEG * turn
        off.append(
            replace(
                pose,
                x=pose.x + float(shift[0]),
                y=pose.y + float(shift[1]),
                z=float(pose.z or 0.0) + float(shift[2]),
                heading=heading + float(angles[0]),
                pitch=pitch + float(angles[1]),
                roll=roll + float(angles[2]),
            )
        )
    east, north = street.world_point(street.length / 2, 0.0).tolist()
    middle = Pose(east, north, 2.5, 0.0)
    bare = replace(street, cutouts=tuple(np.zeros_like(cutout) for cutout in street.cutouts))
    truth = render_street_panorama(bare, middle, 2048, seed=pictures, ground=ground, sides=sides)
    held_out = Panorama(truth, middle, np.zeros(truth.shape[:2], bool))
    line = Street("street", None, shapely.LineString([street.world_point(0, 0), street.world_point(street.length, 0)]))
    poses = tuple(one.pose for one in taken)
    return street, Case(street.scene, (line,), street.charts, tuple(taken), poses, held_out), off


def refine_in_bundles(street: SyntheticStreet, images: Sequence[np.ndarray], given: Sequence[Pose]) -> list[Pose]:
    """Return the poses of pictures refined alone, then those of each bundle together."""
    sizes = [image.shape[:2] for image in images]
    seen = [
        (chart, one.panorama, one.seen_share)
        for chart in street.charts
        for one in find_sightings(street.scene, chart, given, sizes)
    ]
    wall, panorama, share = (np.array(column) for column in zip(*seen, strict=True))
    places = np.array([(pose.x, pose.y) for pose in given])
    bundles = group_panoramas_into_bundles(wall, panorama, share, places, [None] * len(given))
    alone = set(range(len(given))).difference(*bundles)
    refined = list(given)
    for bundle in (*bundles, *((number,) for number in alone)):
        found = refined_poses(street.scene, [images[n] for n in bundle], [given[n] for n in bundle])
        for number, pose in zip(bundle, found["together" if len(bundle) > 1 else "refined"], strict=True):
            refined[number] = pose
    return refined


def _cutouts_in_panorama(street: SyntheticStreet, pose: Pose, width: int) -> np.ndarray:
    """Return the pixels (height, width) bool of a picture that show a cut-out."""
    if pose.lens is None:
        rays = panorama_rays(np.array([0.0, 1.0]), width) @ _from_upright(pose)
    else:
        rays = picture_rays(pose.lens, (width * pose.lens.size[1] // pose.lens.size[0], width)) @ camera_from_world(
            pose
        )
    depth, _ = street.scene.caster.cast(camera_position(pose), rays)
    points = camera_position(pose) + np.where(np.isfinite(depth), depth, FAR_M)[..., None] * rays
    return is_behind_cutout(street, points, pose, assumed_pose=pose)


def _from_upright(pose: Pose) -> np.ndarray:
    """Return the matrix (3, 3) by which rays of a level panorama towards north, as rows, become those of a pose."""
    return camera_from_world(Pose(0.0, 0.0, 0.0, 0.0)).T @ camera_from_world(pose)


def amsterdam_cases(data: Path, block_name: str = "amsterdam-ij") -> list[Case]:
    """Build the example block with each of its panoramas held out in turn; poses are refined with all of them."""
    os.environ["STREETLOOM_DATA"] = str(data.resolve())  # which the packaged block file names
    block = read_block(EXAMPLE_BLOCKS_FOLDER / f"{block_name}.yaml")
    plan = make_plan(block)
    images = [read_panorama(panorama.path) for panorama in block.panoramas]
    poses = refined_poses(plan.scene, images, plan.poses)["together"]
    panoramas = [
        Panorama(image, pose, mask_building_occluders(image, pose)) for image, pose in zip(images, poses, strict=True)
    ]
    return [
        _without(number, panoramas, plan.scene, plan.streets, tuple(plan.facades.chart.tolist()))
        for number in range(len(panoramas))
    ]


def _without(
    number: int, panoramas: Sequence[Panorama], scene: Scene, streets: tuple[Street, ...], facades: tuple[int, ...]
) -> Case:
    taken = tuple(one for other, one in enumerate(panoramas) if other != number)
    return Case(scene, streets, facades, taken, tuple(one.pose for one in taken), panoramas[number])
