"""What pictures show of a facade, source by source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from catalogs.readers.pictures.decoding import MIN_SIDE_PX
from facade_core.core.errors import ImageError
from facade_core.core.resizing import resize_image
from facade_core.core.types import Box, Pose
from facade_core.imagery.detect.detection import Detections, detect_on_image, detect_on_panorama
from facade_core.imagery.rectify.change_detection import detect_changes
from facade_core.imagery.rectify.crop import crop_to_facade, street_mask
from facade_core.imagery.rectify.fusion import ChartView, as_chart_view, fuse_views
from facade_core.imagery.rectify.model_texture import render_model_texture
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.imagery.rectify.panorama import rectify_view
from facade_core.imagery.rectify.photo import Rectified, rectify
from facade_core.parsing.occluders import occluder_mask
from facade_core.parsing.segmenter import parse
from facade_core.plan.plan import Plan
from tasks.engine.outcome import collect_rejections
from tasks.stages.shared.images import capture_date, focal_length, read_panorama, read_textures, read_bounded_picture

if TYPE_CHECKING:
    from tasks.stages.facades.imagery import FacadeImagery

# Texels around a photo's holes that count as hidden.
RIM_TEXELS = 2
# How much pictures of the capture before count beside those of the newest: they are taken where these show nothing.
EARLIER_QUALITY = 0.25
# How it was before is kept, as a picture of at most so many texels to a side, of facades of which at least this share changed.
PICTURED, LONGEST, GREY = 0.02, 320, 176
# A facade of which pictures show less than this is made from an exemplar: there is too little to complete it from.
MIN_SHOWN_SHARE = 0.3


@dataclass(frozen=True)
class FacadeEvidence:
    """What pictures show of a facade.

    Args:
        image: (h, w, 3) uint8.
        hidden: (h, w) bool.
        confidence: (h, w), 0 to 1, the share of the raster's resolution that the picture has and how squarely it looks.
        source: the name of the pictures.
        masked: boxes of things masked.
        masked_share: the share of the facade that these hid.
        clean: whether nothing else can be in front.
        outside: (h, w) bool, where it shows sky, street or neighbours beside the facade; None where nothing is.
        captured: the day of the newest of the pictures, where they tell.
        seen: faces, plates and text, in texels, that hidden does not hold yet.
        fit: how a photo fits the wall; None of other pictures.
        before: how the facade was at the capture before; None where there is one capture.
    """

    image: np.ndarray
    hidden: np.ndarray
    confidence: np.ndarray
    source: str
    masked: tuple[Box, ...] = ()
    masked_share: float = 0.0
    clean: bool = False
    outside: np.ndarray | None = None
    captured: str | None = None
    seen: Detections = field(default_factory=Detections)
    fit: PhotoFit | None = None
    before: EarlierCapture | None = None


class EarlierCapture(NamedTuple):
    """What of a facade changed since an earlier capture, of which the newest picture is of a day: the share of what both show,
    None where that is too little, and the share of the facade that they do; where, by cells; and how it was, a small picture,
    where enough changed to look at it."""

    changed: float | None
    compared: float
    day: str | None
    cells: tuple[str, ...] = ()
    picture: np.ndarray | None = None


class PhotoFit(NamedTuple):
    """How a photo fits its wall: the share of the rectified picture that was cut out, whether a facade was found there at all,
    and how many times wider, for its height, the wall is than what was cut out."""

    kept: float
    found: bool
    stretched: float


class FacadePhoto(NamedTuple):
    """A photo of a facade, cut to it: image (h, w, 3) uint8, what it does not show of the facade and what it shows beside it,
    (h, w) bool, the faces, plates and text on it, and how it fits the wall."""

    image: np.ndarray
    hidden: np.ndarray
    outside: np.ndarray
    seen: Detections
    fit: PhotoFit


def read_evidence(
    source: str,
    plan: Plan,
    chart: int,
    size: tuple[int, int],
    imagery: FacadeImagery,
    textures: Sequence[Path],
    refused: list[Exception],
    parser: Path | None = None,
) -> FacadeEvidence | None:
    """What a source of imagery, as in `FacadeImagery.sources`, shows of a chart in a raster of a size; None where that is too little.

    Why one picture of several cannot be used is added to `rejected_buildings`; raises what a photo, the only one, is refused by. parser:
    the file of one in place of the shipped one.
    """
    if source == "photo" and imagery.photo is not None:
        photo = read_facade_photo(imagery.photo, imagery.rectified, size, parser)
        hidden = _widen(photo.hidden)
        return FacadeEvidence(
            photo.image,
            hidden,
            ~hidden,
            imagery.photo.name,
            masked=photo.seen.private_boxes(size),
            outside=photo.outside,
            captured=capture_date(imagery.photo),
            seen=photo.seen,
            fit=photo.fit,
        )
    if source == "panoramas":
        return _fuse_panoramas(plan, chart, size, imagery, refused, parser)
    images = read_textures(textures, plan.scene.mesh.texture[plan.scene.mesh.chart_triangles(chart)], refused)
    image, covered = render_model_texture(plan.scene, chart, images)
    if covered.mean() < MIN_SHOWN_SHARE:
        return None
    # what a model brings is its wall as its makers want it, and may be drawn: the parser is not asked for trees
    return FacadeEvidence(image, ~covered, covered, "own texture", clean=True)


def _fuse_panoramas(
    plan: Plan, chart: int, size: tuple[int, int], imagery: FacadeImagery, refused: list[Exception], parser: Path | None
) -> FacadeEvidence | None:
    newest, earlier = (
        _dated_views(plan, chart, pictures, size, imagery, refused, parser)
        for pictures in (imagery.panoramas, imagery.earlier)
    )
    if not newest:
        newest, earlier = earlier, []
    views, before = [one.view for one in newest], None
    if not views:
        return None
    if earlier:
        now, then = (as_chart_view(fuse_views(of)) for of in (views, [one.view for one in earlier]))
        told = detect_changes(now, then, float(plan.scene.placement.texels_per_metre[chart]))
        share = None if told.changed_share is None else round(told.changed_share, 4)
        before = EarlierCapture(share, round(told.compared_share, 4), _latest_day(earlier))
        if share is not None:
            picture = _shrink(then) if share >= PICTURED else None
            before = before._replace(
                cells=told.encode_cells(float(plan.scene.placement.texels_per_metre[chart])), picture=picture
            )
        # what is no longer so is not shown; the rest fills what the newest do not show
        views += [
            replace(one.view, seen=one.view.seen & ~told.is_changed, quality=EARLIER_QUALITY * one.view.quality)
            for one in earlier
        ]
    fused = fuse_views(views)
    if (fused.seen & ~fused.occluded).mean() < MIN_SHOWN_SHARE:
        return None
    _, masked = occluder_mask(fused.occluded)
    hidden = _widen(~fused.seen) | fused.occluded
    in_front = float(fused.occluded.mean())
    taken = [*newest, *(one for k, one in enumerate(earlier, len(newest)) if (fused.source == k).any())]
    return FacadeEvidence(
        fused.rgb,
        hidden,
        fused.confidence,
        ", ".join(one.name for one in taken),
        masked,
        in_front,
        outside=street_mask(fused.rgb, hidden, model=parser),
        captured=_latest_day(newest),
        before=before,
    )


def _shrink(view: ChartView) -> np.ndarray:
    """A view (h, w, 3) as it is looked at beside another: no longer than LONGEST, and grey where it does not show the wall."""
    image = np.where(view.clear[..., None], view.rgb, np.uint8(GREY))
    scale = min(1.0, LONGEST / max(image.shape[:2]))
    height, width = (max(1, round(side * scale)) for side in image.shape[:2])
    return resize_image(image, (height, width))


class _DatedView(NamedTuple):
    """A facade as a panorama shows it, the file's name and its day, where that is known."""

    view: ChartView
    name: str
    day: str | None


def _dated_views(
    plan: Plan,
    chart: int,
    pictures: Sequence[tuple[Path, Pose]],
    size: tuple[int, int],
    imagery: FacadeImagery,
    refused: list[Exception],
    parser: Path | None,
) -> list[_DatedView]:
    """A facade as some panoramas show it, those left out that cannot be used."""
    found = []
    for path, pose in pictures:
        with collect_rejections(refused):
            view = _view_of_panorama(plan, chart, path, pose, size, parser)
            found.append(_DatedView(view, path.name, imagery.captured.get(path) or capture_date(path)))
    return found


def _latest_day(taken: Sequence[_DatedView]) -> str | None:
    """The last of the days on which pictures were taken, where they tell."""
    return max((one.day for one in taken if one.day), default=None)


def read_facade_photo(path: Path, rectified: bool, size: tuple[int, int], parser: Path | None = None) -> FacadePhoto:
    """A photo of a facade at a size; rectified first where it is as taken, and cut to the facade."""
    import cv2

    if rectified:
        picture = read_bounded_picture(path, least=MIN_SIDE_PX)
        image, hidden = picture.rgb, picture.hidden | no_data_mask(picture.rgb)
    else:
        found, _ = rectify_photo(path)
        image, hidden = found.image, ~found.seen
    cut = crop_to_facade(image, hidden, model=parser)
    hidden, outside = (
        cv2.resize(mask.astype(np.uint8), size[::-1], interpolation=cv2.INTER_NEAREST).astype(bool)
        for mask in (cut.hidden, cut.outside)
    )
    across, down = size[1] / cut.image.shape[1], size[0] / cut.image.shape[0]
    seen = detect_on_image(cut.image).rescale(across, down)
    fit = PhotoFit(cut.hidden.size / image[..., 0].size, cut.has_facade, across / down)
    return FacadePhoto(resize_image(cut.image, size), hidden, outside, seen, fit)


def rectify_photo(path: Path) -> tuple[Rectified, tuple[int, int]]:
    """A photo as taken from the street, rectified, and its size (h, w) as it was read. Raises ImageError with its name."""
    picture = read_bounded_picture(path, least=MIN_SIDE_PX)
    alpha = np.where(picture.hidden, 0, 255).astype(np.uint8)
    focal = focal_length(path)
    try:
        found = rectify(np.dstack([picture.rgb, alpha]), focal=None if focal is None else focal * picture.scale)
    except ImageError as error:
        raise ImageError(f"{path.name}: {error}") from error
    return found, picture.hidden.shape


def _view_of_panorama(
    plan: Plan, chart: int, path: Path, pose: Pose, size: tuple[int, int], parser: Path | None
) -> ChartView:
    """A facade as a panorama shows it, with the trees, cars and people before it that the parser sees, and the faces and plates
    that there are on the panorama."""
    image = read_panorama(path)
    seen = _panorama_detections(path, pose)
    private = seen.private_mask(image.shape[:2]) if seen.has_private_boxes() else None
    view = rectify_view(plan.scene, chart, image, pose, size, private)
    if not view.seen.any():
        return view
    alpha = np.where(view.seen, 255, 0).astype(np.uint8)
    in_front, _ = occluder_mask(parse(np.dstack([view.rgb, alpha]), model=parser).occluded & view.seen)
    return replace(view, occluded=(in_front if view.occluded is None else in_front | view.occluded) & view.seen)


def _panorama_detections(path: Path, pose: Pose) -> Detections:
    """The faces, plates and text on a panorama; the facades that it shows share them."""
    state = path.stat()
    return _cached_detections(path, state.st_size, state.st_mtime_ns, pose.view)


@lru_cache(maxsize=64)
def _cached_detections(path: Path, _size: int, _modified: int, view: tuple[float, float, float, float]) -> Detections:
    return detect_on_panorama(read_panorama(path), view)


def _widen(hidden: np.ndarray) -> np.ndarray:
    """A hole and its rim: beside it, resampling has mixed in what hides the wall."""
    import cv2

    return cv2.dilate(hidden.astype(np.uint8), np.ones((2 * RIM_TEXELS + 1, 2 * RIM_TEXELS + 1), np.uint8)).astype(bool)
