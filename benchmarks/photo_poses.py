"""Poses of unposed photos of a painted street, as `streetloom match --cameras` finds them: `python -m benchmarks.photo_poses`.

Needs pycolmap (`make sfm-setup`), and no data. Pictures as of `benchmarks.mesh_texturing --perspective`, from a hand's height,
of both sides of a street with cars and trees before the houses. Each states a place that is off by 3 m on either axis. placed:
share of the pictures that have a pose, the median of draws of that noise; groups: pictures that overlap; errors against the
truth over all draws, metres and degrees: placed by GPS alone, and aligned to the walls; of the first draw also after the
refinement of a run. With --texture, of the first draw, what `benchmarks.mesh_texturing` says of the placed pictures at true,
aligned and refined poses: PSNR in dB and SSIM against a panorama held out, textured as a run does, by PyMeshLab and plainly.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.imagery import pose_errors
from benchmarks.mesh_texturing.cases import Case, photograph_perspective, refine_in_bundles
from benchmarks.mesh_texturing.methods import measure_cases
from catalogs.readers.pictures.cameras.placement import place_by_gps
from facade_core.core.types import Pose
from facade_core.geometry.ground.terrain import Terrain
from tasks.engine.compute.worker_setup import limit_threads
from tasks.matching.photo_cameras import PhotoCamera, camera_pose, place_groups
from tasks.matching.settings import MATCHING
from tasks.matching.structure_from_motion import PhotoGroup, reconstruct_photos

# Error of the stated places on either axis, metres.
GPS_NOISE_M = 3.0
HAND_HEIGHTS_M = (1.45, 1.75)
GROUND = Terrain(0.0, 0.0, 1.0, np.zeros((1, 1)))


def measure(
    *, seed: int, buildings: int, pictures: int, width: int, draws: int, texture: bool, views: Path | None
) -> dict[str, Any]:
    """Photograph a street, find the poses, and compare them with the truth."""
    street, case, _ = photograph_perspective(
        seed=seed, buildings=buildings, pictures=pictures, width=width, heights=HAND_HEIGHTS_M
    )
    noise = np.random.default_rng([seed, 1]).normal(0, GPS_NOISE_M, (draws, pictures, 2))
    drawn = np.array([(pose.x, pose.y) for pose in case.poses]) + noise
    with tempfile.TemporaryDirectory(prefix="photo-poses-") as folder:
        files = [Path(folder) / f"{number:04}.png" for number in range(pictures)]
        for file, image in zip(files, case.images, strict=True):
            cv2.imwrite(str(file), image[..., ::-1])
        begun = time.perf_counter()
        groups, _ = reconstruct_photos(files, drawn[0])
        seconds = time.perf_counter() - begun
        placed = [place_groups(case.scene, GROUND, groups, files, places) for places in drawn]
        pairs = [_pairs(case, files, found.cameras) for found in placed]
        by_gps = [_pairs(case, files, _place_by_gps(groups, files, places)) for places in drawn]
        result: dict[str, Any] = {
            "benchmark": "photo_poses",
            "pictures": pictures,
            "street_metres": round(street.length, 1),
            "seconds": round(seconds, 1),
            "groups": [len(group.paths) for group in groups],
            "placed": round(statistics.median(len(each) for each in pairs) / pictures, 3),
            "gps": _errors([pair for each in by_gps for pair in each]),
            "walls": _errors([pair for each in pairs for pair in each]),
        }
        chosen = [number for number, file in enumerate(files) if file.name in placed[0].cameras]
        case = replace(
            case,
            taken=tuple(case.taken[number] for number in chosen),
            poses=tuple(case.poses[number] for number in chosen),
        )
        aligned = [pose for pose, _ in pairs[0]]
        refined = refine_in_bundles(street, case.images, aligned)
        ways = {"true": case.poses, "walls": aligned, "refined": refined}
        result["first"] = {name: pose_errors(poses, case.poses) for name, poses in ways.items() if name != "true"}
        if texture:
            result["textured"] = {
                name: measure_cases([replace(case, poses=tuple(each))], pictures=views and views / name)
                for name, each in ways.items()
            }
    return result


def _pairs(case: Case, files: Sequence[Path], cameras: Mapping[str, PhotoCamera]) -> list[tuple[Pose, Pose]]:
    """Return the found and the true pose of each picture that has a camera."""
    return [
        (camera_pose(*cameras[file.name]), true)
        for file, true in zip(files, case.poses, strict=True)
        if file.name in cameras
    ]


def _errors(pairs: Sequence[tuple[Pose, Pose]]) -> dict[str, float]:
    return pose_errors([found for found, _ in pairs], [true for _, true in pairs])


def _place_by_gps(groups: Sequence[PhotoGroup], files: Sequence[Path], places: np.ndarray) -> dict[str, PhotoCamera]:
    """Place groups by GPS alone, at a hand's height."""
    by_path, cameras = dict(zip(files, places, strict=True)), {}
    for group in groups:
        own = np.array([(*by_path[path], MATCHING.hand_height_m) for path in group.paths])
        gps = place_by_gps("pictures", group.centres, group.rotations, own)
        for path, centre, rotation, lens in zip(
            group.paths, gps.apply(group.centres), group.rotations @ gps.rotation.T, group.lenses, strict=True
        ):
            cameras[path.name] = PhotoCamera(centre, rotation, lens)
    return cameras


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--buildings", type=int, default=6, help="houses on the street, an even number")
    parser.add_argument("--pictures", type=int, default=60)
    parser.add_argument("--width", type=int, default=640, help="pixels of a picture")
    parser.add_argument("--draws", type=int, default=10, help="how often the errors of places are drawn")
    parser.add_argument("--texture", action="store_true", help="texture the street from the poses, which takes minutes")
    parser.add_argument("--views", type=Path, help="with --texture, folder for views: truth, ours, plain, meshlab")
    options = parser.parse_args()
    limit_threads()
    print(json.dumps(measure(**vars(options)), indent=1))


if __name__ == "__main__":
    main()
