"""Worker of the harvest: find, judge and complete the facades of one picture."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catalogs.published.folders import write_atomically
from catalogs.readers.pictures.embedded_poses import read_panorama_view
from facade_core.core.arrays import UInt8Array
from facade_core.core.errors import FacadeError, ImageError
from facade_core.core.name_hash import hash_name
from facade_core.core.resizing import resize_image, resize_with_labels
from facade_core.export.pictures.rendering import encode_image
from facade_core.facade.facade_statistics import measure_facade_statistics
from facade_core.facade.harvesting import HarvestedFacade, harvest_facade
from facade_core.imagery.detect.detection import detectors_available
from facade_core.imagery.detect.facade_detection import detect_on_thumbnail
from facade_core.imagery.privacy import apply_privacy
from facade_core.imagery.rectify.full_circle import check_full_panorama
from facade_core.imagery.rectify.panorama_views import cut_panorama_views
from facade_core.imagery.rectify.photo_state import check_daylight
from facade_core.plan.exemplar_style import style_descriptor
from tasks.engine.outcome import error_reason, is_machine_fault
from tasks.harvest.record import CANDIDATES_FOLDER, CandidateRecord, PictureRecord, write_picture_record
from tasks.stages.shared.images import read_photo

# Density at which styles are compared, pixels per metre: that of textures.
STYLE_PIXELS_PER_METRE = 20.0
# Longest side in pixels of the picture of a rejected facade.
REJECTED_SIDE_PX = 240


class PhotoView(NamedTuple):
    """Photo, or view of a panorama.

    Attributes
    ----------
    name : name of its candidate.
    image : (h, w, 4) uint8.
    focal : focal length in pixels; None if unknown.
    night : why the whole picture, with its sky, is not of the day; None if it is.
    """

    name: str
    image: UInt8Array
    focal: float | None
    night: ImageError | None


def harvest_picture(path: Path, name: str, digest: str, key: str, out: Path) -> PictureRecord:
    """Harvest the facades of a picture: write each to the folder of candidates, and then the record.

    Parameters
    ----------
    path : file of the picture.
    name : name of its candidates, unique among the pictures.
    digest : digest of the file.
    key : digest of all that the result depends on.
    out : folder of the style library.
    """
    start = time.perf_counter()
    candidates: list[CandidateRecord] = []
    try:
        for view in _read_views(path, name):
            candidates.append(_harvest_view(view, f"{digest[:20]}-{len(candidates)}", out))
    except Exception as error:
        if is_machine_fault(error):
            raise
        file = f"{digest[:20]}-{len(candidates)}"
        _write_picture(out, file, np.full((REJECTED_SIDE_PX // 2, REJECTED_SIDE_PX // 2, 3), 128, np.uint8))
        candidates.append({"name": name, "file": file, "reason": error_reason(error)})
    record = PictureRecord(
        key=key,
        candidates=candidates,
        seconds=round(time.perf_counter() - start, 2),
        looked=detectors_available(),
    )
    write_picture_record(out, digest, record)
    return record


def _read_views(path: Path, name: str) -> Iterator[PhotoView]:
    """Read a picture as the photos that it consists of: a panorama is cut to views."""
    picture = read_photo(path)
    night = None
    try:
        check_daylight(picture.rgb, picture.hidden, picture.state.exposure)
    except ImageError as error:
        night = error
    part = read_panorama_view(path)
    if part is not None and _is_panorama(picture.rgb, part):
        for view in cut_panorama_views(picture.rgb, part):
            yield PhotoView(f"{name}-{view.heading:03.0f}", view.image, view.focal, night)
        return
    alpha = np.where(picture.hidden, 0, 255).astype(np.uint8)
    yield PhotoView(name, np.dstack([picture.rgb, alpha]), picture.state.focal_px, night)


def _is_panorama(image: UInt8Array, part: tuple[float, float, float, float]) -> bool:
    """Return whether a picture of a panorama's proportions is one; a stated part of one is."""
    if part != (0.0, 0.0, 1.0, 1.0):
        return True
    try:
        check_full_panorama(image)
    except FacadeError:
        return False
    return True


def _harvest_view(view: PhotoView, file: str, out: Path) -> CandidateRecord:
    """Harvest the facade of one view, and write it; one in which none is found is written small."""
    try:
        if view.night is not None:
            raise view.night
        found = harvest_facade(view.image, view.focal, seed=hash_name(view.name))
        texture, labels = _at_style_density(found)
        look = style_descriptor(texture, labels, 1 / STYLE_PIXELS_PER_METRE)
        statistics = measure_facade_statistics(found.image, found.labels, found.metres_per_pixel)
    except Exception as error:
        if is_machine_fault(error):
            raise
        _write_picture(out, file, _small_and_private(view.image[..., :3]))
        reason = error_reason(error).removeprefix("photo: ")
        return {"name": view.name, "file": file, "reason": reason}
    record: CandidateRecord = {
        "name": view.name,
        "file": file,
        "score": round(found.judgement.quality.score, 4),
        "parts": asdict(found.judgement.quality),
        "metres_per_pixel": round(found.metres_per_pixel, 6),
        "width_m": round(found.labels.shape[1] * found.metres_per_pixel, 2),
        "height_m": round(found.labels.shape[0] * found.metres_per_pixel, 2),
        "floors": found.floors,
        "columns": found.columns,
        "hidden": round(float(found.hidden.mean()), 4),
        "look": look,
        "statistics": statistics._asdict(),
    }
    if found.judgement.reasons:
        _write_picture(out, file, _small_and_private(found.image))
        return {**record, "reason": "; ".join(found.judgement.reasons)}
    _write_picture(out, file, found.image)
    _write_picture(out, f"{file}.labels", found.labels)
    return record


def _at_style_density(found: HarvestedFacade) -> tuple[UInt8Array, UInt8Array]:
    factor = found.metres_per_pixel * STYLE_PIXELS_PER_METRE
    height, width = (max(8, round(side * factor)) for side in found.labels.shape)
    return resize_with_labels(found.image, found.labels, (height, width))


def _small_and_private(image: UInt8Array) -> UInt8Array:
    """Reduce the picture of a rejected facade, and blur faces and plates that can still be found in it."""
    factor = min(1.0, REJECTED_SIDE_PX / max(image.shape[:2]))
    height, width = (max(1, round(side * factor)) for side in image.shape[:2])
    small = resize_image(image, (height, width))
    private = detect_on_thumbnail(small).private_mask((height, width))
    return apply_privacy(small, private, "blur", STYLE_PIXELS_PER_METRE)


def _write_picture(out: Path, file: str, image: UInt8Array) -> None:
    write_atomically(out / CANDIDATES_FOLDER / f"{file}.png", encode_image(image, "png"))
