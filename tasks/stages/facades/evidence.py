"""Evidence of a facade: its image from photos, panoramas or model textures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import ImageError
from facade_core.core.resizing import resize_image
from facade_core.core.types import SHIPPED_MODELS, Pose, TrainedModelFiles
from facade_core.facade.evidence import Evidence
from facade_core.imagery.cameras.camera_view import apply_exposure_factor
from facade_core.imagery.detect.detection import FacesPlatesAndText, detect_on_panorama
from facade_core.imagery.rectify.change_detection import ChangeSinceCapture, detect_changes
from facade_core.imagery.rectify.colour_fringes import remove_colour_fringes
from facade_core.imagery.rectify.crop import wall_surroundings_mask
from facade_core.imagery.rectify.element_parallax import grey_where_clear
from facade_core.imagery.rectify.fusion import ChartView, as_chart_view, fuse_views
from facade_core.imagery.rectify.model_texture import render_model_texture
from facade_core.imagery.rectify.panorama import rectify_chart_from_panorama
from facade_core.imagery.rectify.pictured_plane import camera_in_chart_frame, explain_other_planes
from facade_core.imagery.rectify.veil import remove_veil
from facade_core.parsing.occluders import clean_occluder_mask
from facade_core.parsing.segmenter import parse
from facade_core.plan.plan import Plan
from tasks.engine.outcome import collect_input_errors
from tasks.stages.facades.photos import read_facade_photo, widen_holes
from tasks.stages.shared.images import (
    capture_date,
    max_picture_pixels,
    read_panorama,
    read_textures,
)

if TYPE_CHECKING:
    from tasks.stages.facades.imagery import FacadeImagery

# How much pictures of the capture before count beside those of the newest: they are taken where these show nothing.
EARLIER_QUALITY = 0.25
# How it was before is kept, as a picture of at most so many texels to a side, of facades of which at least this share changed.
PICTURED, LONGEST, GREY = 0.02, 320, 176
# A facade of which pictures show less than this is made from an exemplar: there is too little to complete it from,
MIN_SHOWN_SHARE = 0.3
# unless they show so many square metres, two storeys of a house, that are at least this share of it. Of a tall building a
# street shows the foot.
MIN_SHOWN_M2 = 25.0
MIN_LARGE_SHOWN_SHARE = 0.2
# Occluders are looked for in a view of so many texels where the raster has fewer, at most so many times finer to a side.
PARSED_VIEW_TEXELS, MAX_FINER = 500_000, 2.0


def read_evidence(
    source: str,
    plan: Plan,
    chart: int,
    size: tuple[int, int],
    imagery: FacadeImagery,
    textures: Mapping[int, Path],
    refused: list[Exception],
    models: TrainedModelFiles = SHIPPED_MODELS,
) -> Evidence | None:
    """Read the image and masks of a facade from a source; None if it shows too little.

    Parameters
    ----------
    source : as of `iterate_sources`.
    size : height and width of the raster.
    textures : pictures of the model on the chart, by number.
    refused : errors of single pictures of several are appended.
    models : trained models.

    Raises
    ------
    ImageError : the only picture, a photo, cannot be used.
    """
    if source == "photo" and imagery.photo is not None:
        return read_facade_photo(imagery.photo, imagery.rectified, size, models)
    if source == "panoramas":
        return _fuse_panoramas(plan, chart, size, imagery, refused, models)
    images = read_textures(textures, refused)
    image, covered = render_model_texture(plan.scene, chart, images)
    if not _shows_enough(plan, chart, covered, has_other=False):
        return None
    # what a model brings is its wall as its makers want it, and may be drawn: the parser is not asked for trees
    return Evidence(image=image, hidden=~covered, confidence=covered, source="own texture", is_clean=True)


def _shows_enough(plan: Plan, chart: int, shown: BoolArray, *, has_other: bool) -> bool:
    """Report whether what pictures show of a facade, (h, w) bool, is enough to complete it.

    `has_other`: a texture of the model can show more of it.
    """
    share = float(shown.mean())
    if share >= MIN_SHOWN_SHARE or has_other:
        return share >= MIN_SHOWN_SHARE
    return share >= MIN_LARGE_SHOWN_SHARE and share * float(plan.scene.charts.size[chart].prod()) >= MIN_SHOWN_M2


def _fuse_panoramas(
    plan: Plan,
    chart: int,
    size: tuple[int, int],
    imagery: FacadeImagery,
    refused: list[Exception],
    models: TrainedModelFiles,
) -> Evidence | None:
    newest, earlier = (
        _dated_views(plan, chart, pictures, size, imagery, refused, models)
        for pictures in (imagery.panoramas, imagery.earlier)
    )
    newest, earlier = _reject_other_planes(plan, chart, newest, earlier, refused)
    if not newest:
        newest, earlier = earlier, []
    views, before = [one.view for one in newest], None
    if not views:
        return None
    if earlier:
        now, then = (as_chart_view(fuse_views(of)) for of in (views, [one.view for one in earlier]))
        told = detect_changes(now, then, _raster_density(plan, chart, size))
        share = None if told.changed_share is None else round(told.changed_share, 4)
        before = ChangeSinceCapture(share, round(told.compared_share, 4), _latest_day(earlier))
        if share is not None:
            picture = _shrink(then) if share >= PICTURED else None
            before = before._replace(cells=told.encode_cells(_raster_density(plan, chart, size)), picture=picture)
        # what is no longer so is not shown; the rest fills what the newest do not show
        views += [
            replace(one.view, seen=one.view.seen & ~told.is_changed, quality=EARLIER_QUALITY * one.view.quality)
            for one in earlier
        ]
    fused = fuse_views(views)
    if not _shows_enough(plan, chart, fused.seen & ~fused.occluded, has_other=imagery.textured):
        return None
    _, masked = clean_occluder_mask(fused.occluded)
    hidden = widen_holes(~fused.seen) | fused.occluded
    in_front = float(fused.occluded.mean())
    taken = [*newest, *(one for k, one in enumerate(earlier, len(newest)) if (fused.source == k).any())]
    return Evidence(
        image=fused.rgb,
        hidden=hidden,
        confidence=fused.confidence,
        source=", ".join(one.path.name for one in taken),
        masked=masked,
        masked_share=in_front,
        outside=wall_surroundings_mask(fused.rgb, hidden, model=models),
        captured=_latest_day(newest),
        before=before,
        pictures=tuple((one.path, one.pose) for one in (*newest, *earlier)),
        picture=fused.source,
        grey=tuple(one.grey for one in newest),
    )


def _raster_density(plan: Plan, chart: int, size: tuple[int, int]) -> float:
    """Return the texels per metre of a raster (height, width) of a chart: that of the atlas, or of `street_density`."""
    placement = plan.scene.placement
    is_atlas = size == placement.shape(chart)
    return float((placement.texels_per_metre if is_atlas else plan.street_density)[chart])


def _shrink(view: ChartView) -> UInt8Array:
    """Return a small copy of a view (h, w, 3), grey where it does not show the wall."""
    image = np.where(view.clear[..., None], view.rgb, np.uint8(GREY))
    scale = min(1.0, LONGEST / max(image.shape[:2]))
    height, width = (max(1, round(side * scale)) for side in image.shape[:2])
    return resize_image(image, (height, width))


class _DatedView(NamedTuple):
    """A facade in a panorama, also finer and in grey (h, w) uint8, 0 where not clear, with its file, pose and day."""

    view: ChartView
    grey: UInt8Array
    path: Path
    pose: Pose
    day: str | None


def _reject_other_planes(
    plan: Plan, chart: int, newest: list[_DatedView], earlier: list[_DatedView], refused: list[Exception]
) -> tuple[list[_DatedView], list[_DatedView]]:
    """Return the views without those that show another building than the facade's; their reasons go to `refused`."""
    every = [*newest, *earlier]
    if not every:
        return newest, earlier
    reasons = explain_other_planes(
        [one.view for one in every],
        [camera_in_chart_frame(plan.scene, chart, one.pose) for one in every],
        _raster_density(plan, chart, every[0].view.seen.shape),
    )
    refused += [
        ImageError(
            f"{one.path.name}: shows another plane than this wall, {reason}; add the building that is there to the model, "
            "mend the pose, or remove the picture"
        )
        for one, reason in zip(every, reasons, strict=True)
        if reason
    ]
    kept = [not reason for reason in reasons]
    return list(compress(newest, kept)), list(compress(earlier, kept[len(newest) :]))


def _dated_views(
    plan: Plan,
    chart: int,
    pictures: Sequence[tuple[Path, Pose]],
    size: tuple[int, int],
    imagery: FacadeImagery,
    refused: list[Exception],
    models: TrainedModelFiles,
) -> list[_DatedView]:
    """Return the views of a facade in some panoramas, without unusable ones."""
    found = []
    for path, pose in pictures:
        with collect_input_errors(refused):
            view, grey = _view_of_panorama(plan, chart, path, pose, size, models)
            if path in imagery.exposure_factors:
                view = replace(view, rgb=apply_exposure_factor(view.rgb, np.array(imagery.exposure_factors[path])))
            found.append(_DatedView(view, grey, path, pose, imagery.captured.get(path) or capture_date(path)))
    return found


def _latest_day(taken: Sequence[_DatedView]) -> str | None:
    """Return the latest day of some views, if any is known."""
    return max((one.day for one in taken if one.day), default=None)


def _view_of_panorama(
    plan: Plan, chart: int, path: Path, pose: Pose, size: tuple[int, int], models: TrainedModelFiles
) -> tuple[ChartView, UInt8Array]:
    """Return the view of a facade in a panorama, and finer in grey, 0 where not clear.

    The view has the occluders that the parser finds, and faces and plates.
    """
    image = read_sharp_panorama(path, pose)
    seen = _panorama_detections(path, pose)
    private = seen.private_mask(image.shape[:2]) if seen.has_private_boxes() else None
    extent = np.array(size[::-1]) / _raster_density(plan, chart, size)
    view = rectify_chart_from_panorama(plan.scene, chart, image, pose, size, private, extent)
    if not view.seen.any():
        return view, np.zeros(size, np.uint8)
    finer = min(MAX_FINER, math.sqrt(PARSED_VIEW_TEXELS / (size[0] * size[1])))
    parsed = view
    if finer > 1:
        fine_size = (round(finer * size[0]), round(finer * size[1]))
        parsed = rectify_chart_from_panorama(plan.scene, chart, image, pose, fine_size, extent=extent)
    alpha = np.where(parsed.seen, 255, 0).astype(np.uint8)
    found = parse(np.dstack([parsed.rgb, alpha]), model=models).occluded & parsed.seen
    occluded_share = resize_image(np.where(found, 255, 0).astype(np.uint8), size)
    in_front, _ = clean_occluder_mask((occluded_share >= 128) & view.seen)
    view = replace(view, occluded=(in_front if view.occluded is None else in_front | view.occluded) & view.seen)
    return view, grey_where_clear(replace(parsed, occluded=found))


def read_sharp_panorama(path: Path, pose: Pose) -> UInt8Array:
    """Read a panorama (h, w, 3) uint8 without veil and colour fringes; consecutive facades share it."""
    return _read_corrected(path, *_file_stamps(path), max_picture_pixels(pose))


def _panorama_detections(path: Path, pose: Pose) -> FacesPlatesAndText:
    """Return faces, plates and text on a panorama; its facades share them."""
    # the same at any place
    unplaced = Pose(0.0, 0.0, None, 0.0, view=pose.view, lens=pose.lens)
    return _cached_detections(path, *_file_stamps(path), unplaced, max_picture_pixels(pose))


def _file_stamps(path: Path) -> tuple[int, int]:
    """Return size and time of a file, by which a changed one is read again."""
    state = path.stat()
    return state.st_size, state.st_mtime_ns


@lru_cache(maxsize=1)
def _read_corrected(path: Path, _size: int, _modified: int, max_pixels: int) -> UInt8Array:
    return remove_colour_fringes(remove_veil(read_panorama(path, max_pixels)))


@lru_cache(maxsize=64)
def _cached_detections(path: Path, _size: int, _modified: int, pose: Pose, max_pixels: int) -> FacesPlatesAndText:
    return detect_on_panorama(read_panorama(path, max_pixels), pose)
