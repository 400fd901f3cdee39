"""Structure from motion by pycolmap, as a process of its own: `python -m tasks.matching.colmap_process FOLDER`.

Its wheel exports the symbols of libpng and zlib, with which OpenCV aborts in the same process: nothing else is imported.
FOLDER holds job.json and the pictures. Writes "STEP COUNT" to stdout as it goes, and writes model-N.npz, the largest first.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tasks.matching.settings import MATCHING

SEED = 1


def write_progress(step: str, count: int) -> None:
    """Write a line of progress to the process that started this one."""
    os.write(sys.stdout.fileno(), f"{step} {count}\n".encode())


def reconstruct(folder: Path, report: Callable[[str, int], None]) -> None:
    """Run the job of a folder, and write its models there."""
    pycolmap: Any = importlib.import_module("pycolmap")
    pycolmap.logging.minloglevel = pycolmap.logging.ERROR
    pycolmap.set_random_seed(SEED)
    job = json.loads((folder / "job.json").read_text())
    database = folder / "database.db"
    for group in job["groups"]:
        _extract(pycolmap, folder, database, group, report)
    _match(pycolmap, folder, database, job["pairs"], report)
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = SEED
    options.num_threads = 1  # sums in one order
    options.min_model_size = MATCHING.min_model_pictures
    options.extract_colors = False
    options.structure_less_registration_fallback = False  # places pictures of another side of the street among these
    options.mapper.abs_pose_min_num_inliers = MATCHING.min_points
    options.mapper.random_seed = options.triangulation.random_seed = SEED
    (folder / "models").mkdir()
    models = pycolmap.incremental_mapping(
        database, folder, folder / "models", options, next_image_callback=lambda: report("poses", 1)
    )
    ordered = sorted(models.items(), key=lambda item: (-item[1].num_reg_images(), item[0]))
    for number, (_, model) in enumerate(ordered):
        np.savez(folder / f"model-{number}.npz", **model_arrays(model))


def _extract(
    pycolmap: Any, folder: Path, database: Path, group: dict[str, Any], report: Callable[[str, int], None]
) -> None:
    """Extract the features of the pictures of one camera."""
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.num_threads = 1
    extraction.sift.max_num_features = MATCHING.max_features
    extraction.sift.first_octave = 0
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "SIMPLE_RADIAL"
    if group["focal"] is not None:
        width, height = group["size"]
        reader.camera_params = f"{group['focal']},{width / 2},{height / 2},0"
    for names in _chunks(group["names"], MATCHING.progress_pictures):
        pycolmap.extract_features(
            database, folder, names, pycolmap.CameraMode.SINGLE, reader, extraction, device=pycolmap.Device.cpu
        )
        if reader.existing_camera_id < 0 or names[0] == group["names"][0]:
            with pycolmap.Database.open(database) as opened:
                reader.existing_camera_id = opened.read_image_with_name(names[0]).camera_id
        report("features", len(names))


def _match(
    pycolmap: Any, folder: Path, database: Path, pairs: Sequence[Sequence[str]], report: Callable[[str, int], None]
) -> None:
    """Match pairs of pictures; each pair is verified from the same seed."""
    pairing, verification = pycolmap.ImportedPairingOptions(), pycolmap.TwoViewGeometryOptions()
    matching = pycolmap.FeatureMatchingOptions()
    matching.num_threads = 1
    pairing.match_list_path = folder / "pairs.txt"
    verification.min_num_inliers = MATCHING.min_shared_features
    verification.ransac.random_seed = SEED
    for some in _chunks(pairs, MATCHING.progress_pairs):
        (folder / "pairs.txt").write_text("".join(f"{one} {other}\n" for one, other in some))
        pycolmap.match_image_pairs(database, matching, pairing, verification, device=pycolmap.Device.cpu)
        report("pairs", len(some))


def _chunks(items: Sequence[Any], size: int) -> list[list[Any]]:
    return [list(items[start : start + size]) for start in range(0, len(items), size)]


def model_arrays(model: Any) -> dict[str, Any]:
    """Return a model as arrays: names (n,), rotations to camera axes (n, 3, 3), centres (n, 3), lenses (n, 4), points (m, 3).

    A lens is focal length, principal point and the first radial coefficient; `camera` (m,) is a picture of each point.
    """
    found = (image for image in model.images.values() if image.has_pose and image.num_points3D >= MATCHING.min_points)
    images = sorted(found, key=lambda image: image.name)
    row = {image.image_id: number for number, image in enumerate(images)}
    points, camera = [], []
    for _, point in sorted(model.points3D.items()):
        seen = sorted({one.image_id for one in point.track.elements} & row.keys())
        if len(seen) >= MATCHING.min_track:
            points.append(point.xyz)
            camera.append(row[seen[0]])
    return {
        "names": np.array([image.name for image in images]),
        "rotation": np.array([image.cam_from_world().rotation.matrix() for image in images]),
        "centre": np.array([image.projection_center() for image in images]),
        "lens": np.array([model.cameras[image.camera_id].params for image in images]),
        "points": np.array(points).reshape(-1, 3),
        "camera": np.array(camera, np.int32),
    }


if __name__ == "__main__":
    reconstruct(Path(sys.argv[1]), write_progress)
