"""Structure from motion of a folder of photos, by pycolmap in a process of its own."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.features import Fault
from catalogs.reader_errors import is_system_error
from catalogs.readers.pictures.capture_dates import exif_focal_length_px
from catalogs.readers.pictures.decoding import open_picture
from facade_core.core.arrays import Float64Array, Int32Array, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.types import Lens
from facade_core.imagery.poses.photo_pairs import choose_pairs
from tasks.engine.child_processes import end_with_parent
from tasks.engine.outcome import error_reason
from tasks.engine.progress import begin_stage, report_progress
from tasks.matching.settings import MATCHING

if TYPE_CHECKING:
    from PIL.Image import Image

_ORIENTATION_TAG, _MAKE_TAG, _MODEL_TAG = 0x0112, 0x010F, 0x0110


@dataclass(frozen=True, slots=True, eq=False)
class PhotoGroup:
    """Photos that overlap, in a frame of their own.

    Attributes
    ----------
    paths : n photos.
    orientations : EXIF orientation of each.
    rotations : (n, 3, 3) from the frame to camera axes x right, y down, z ahead, of the photos as stored.
    centres : (n, 3).
    lenses : lens of each, in pixels of a smaller copy.
    points : (m, 3) points that three of them or more show.
    camera : (m,) number of a photo that shows the point.
    """

    paths: tuple[Path, ...]
    orientations: tuple[int, ...]
    rotations: Float64Array
    centres: Float64Array
    lenses: tuple[Lens, ...]
    points: Float64Array
    camera: Int32Array


@dataclass(frozen=True, slots=True)
class _SmallCopy:
    """Grey copy of a photo in the working folder."""

    path: Path
    name: str
    size: tuple[int, int]
    orientation: int
    camera: tuple[object, ...]
    focal: float | None


def require_pycolmap() -> None:
    """Raise InputError with the remedy where pycolmap is not installed."""
    if importlib.util.find_spec("pycolmap") is None:
        raise InputError(
            "--cameras: pycolmap, which finds the poses, is not installed; `pip install 'streetloom[sfm]'` or `make sfm-setup` "
            "adds it"
        )


def reconstruct_photos(photos: Sequence[Path], places: Float64Array) -> tuple[list[PhotoGroup], list[Fault]]:
    """Find the poses of photos relative to each other.

    Photos are compared with their neighbours by name and by place. The result is the same for the same photos on one
    machine: features, pairs and adjustment use one thread and fixed seeds.

    Parameters
    ----------
    photos : photos in the order of their names.
    places : (n, 2) measured places, metres; NaN where unknown.

    Returns
    -------
    Groups, the largest first, each photo in one at most; and a fault for each photo that cannot be read.

    Raises
    ------
    InputError : pycolmap is missing or fails, or fewer than MATCHING.min_photos photos can be read.
    """
    require_pycolmap()
    with tempfile.TemporaryDirectory(prefix="streetloom-match-") as name:
        folder = Path(name)
        copies, faults = _copy_photos(photos, folder)
        if len(copies) < MATCHING.min_photos:
            raise InputError(
                f"{len(copies)} of {len(photos)} photos can be read, and {MATCHING.min_photos} that overlap are needed; add "
                "some, or give poses under imagery.cameras"
            )
        readable = {copy.path for copy in copies}
        used = [number for number, path in enumerate(photos) if path in readable]
        pairs = choose_pairs(places[used])
        cameras: dict[tuple[object, ...], list[_SmallCopy]] = {}
        for copy in copies:
            cameras.setdefault(copy.camera, []).append(copy)
        groups = [
            {"names": [copy.name for copy in some], "focal": some[0].focal, "size": some[0].size}
            for some in cameras.values()
        ]
        named = [(copies[a].name, copies[b].name) for a, b in pairs.tolist()]
        (folder / "job.json").write_text(json.dumps({"groups": groups, "pairs": named}))
        _run_process(folder, {"features": len(copies), "pairs": len(named), "poses": len(copies)})
        return _read_groups(folder, copies), faults


def _copy_photos(photos: Sequence[Path], folder: Path) -> tuple[list[_SmallCopy], list[Fault]]:
    """Write a grey copy of each photo, as stored, of at most MATCHING.max_side_px."""
    copies, faults = [], []
    begin_stage("photos", len(photos))
    for number, path in enumerate(photos):
        try:
            copies.append(_copy_photo(path, folder, f"{number:06}.png"))
        except Exception as error:  # libraries raise errors of any class
            if is_system_error(error):
                raise
            faults.append(Fault(path.name, "photo", error_reason(error)))
        report_progress("photos", 1)
    return copies, faults


def _copy_photo(path: Path, folder: Path, name: str) -> _SmallCopy:
    with open_picture(path) as image:
        stored, (orientation, maker) = image.size, _read_camera_tags(image)
        focal = exif_focal_length_px(image)
        share = min(1.0, MATCHING.max_side_px / max(stored))
        size = (max(1, round(stored[0] * share)), max(1, round(stored[1] * share)))
        _shrink(image, "L", size).save(folder / name, compress_level=1)
    focal = None if focal is None else focal * share
    return _SmallCopy(path, name, size, orientation if 1 <= orientation <= 8 else 1, (size, focal, *maker), focal)


def read_small_copy(path: Path, size: tuple[int, int]) -> UInt8Array:
    """Read a photo as stored, (h, w, 3) uint8, at a width and height."""
    with open_picture(path) as image:
        return np.asarray(_shrink(image, "RGB", size), np.uint8)


def _shrink(image: Image, mode: str, size: tuple[int, int]) -> Image:
    from PIL.Image import Resampling

    image.draft(mode, size)
    shallow = image.point(lambda value: value / 256) if image.mode.startswith("I") else image  # of 16 bits
    return shallow.convert(mode).resize(size, Resampling.BOX)


def _read_camera_tags(image: Image) -> tuple[int, tuple[str, str]]:
    """Return orientation, and make and model; those that EXIF does not state are 1 and empty."""
    orientation, maker = 1, ("", "")
    with suppress(Exception):  # damaged EXIF
        exif = image.getexif()
        maker = (str(exif.get(_MAKE_TAG)), str(exif.get(_MODEL_TAG)))
        if image.format != "TIFF":  # Pillow rotates TIFF
            orientation = int(exif.get(_ORIENTATION_TAG, 1))
    return orientation, maker


def _run_process(folder: Path, totals: dict[str, int]) -> None:
    """Run pycolmap on a folder, and report its progress."""
    begun: set[str] = set()
    with (folder / "errors.txt").open("w+", encoding="utf-8", errors="replace") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "tasks.matching.colmap_process", str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=errors,
            encoding="utf-8",
            errors="replace",
            preexec_fn=end_with_parent,
        )
        try:
            assert process.stdout is not None
            for line in process.stdout:
                step, _, count = line.partition(" ")
                if step not in totals:
                    continue
                if step not in begun:
                    begun.add(step)
                    begin_stage(step, totals[step])
                report_progress(step, int(count))
            code = process.wait()
        finally:
            process.kill()
            process.wait()
        errors.seek(0)
        said = errors.read().strip().splitlines()
    if code:
        reason = said[-1][: MATCHING.max_reason_length] if said else f"exit code {code}"
        raise InputError(
            f"pycolmap failed ({reason}); try fewer photos, or find poses elsewhere and name them in imagery.cameras"
        )


def _read_groups(folder: Path, copies: Sequence[_SmallCopy]) -> list[PhotoGroup]:
    """Read the models; a photo that two of them have stays in the larger one."""
    by_name = {copy.name: copy for copy in copies}
    placed: set[str] = set()
    groups = []
    for file in sorted(folder.glob("model-*.npz"), key=lambda path: int(path.stem.partition("-")[2])):
        with np.load(file) as model:
            arrays = {key: model[key] for key in model.files}
        names = arrays["names"].tolist()
        own = np.array([name not in placed for name in names], bool)
        if own.sum() < MATCHING.min_photos:
            continue
        placed.update(names)
        chosen = [by_name[name] for name, is_own in zip(names, own, strict=True) if is_own]
        row = np.cumsum(own) - 1
        seen = own[arrays["camera"]]
        groups.append(
            PhotoGroup(
                tuple(copy.path for copy in chosen),
                tuple(copy.orientation for copy in chosen),
                arrays["rotation"][own],
                arrays["centre"][own],
                tuple(
                    Lens(copy.size, (lens[0], lens[0]), (lens[1], lens[2]), (lens[3],))
                    for copy, lens in zip(chosen, arrays["lens"][own].tolist(), strict=True)
                ),
                arrays["points"][seen],
                row[arrays["camera"][seen]].astype(np.int32),
            )
        )
    return groups
