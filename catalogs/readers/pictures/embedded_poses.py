"""What pictures state of themselves in GPano and EXIF tags: the part of a panorama, place and heading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, SupportsFloat

from catalogs.crs import LONLAT
from catalogs.readers.pictures.capture_dates import exif_capture_date
from catalogs.readers.pictures.decoding import open_picture
from catalogs.readers.pictures.source_poses import SourcePose, TagValue, degrees_from_dms
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import ImageError

if TYPE_CHECKING:
    from PIL.Image import Image

_GPS_IFD = 0x8825
_ORIENTATION_TAG = 0x0112
_FULL_VIEW = (0.0, 0.0, 1.0, 1.0)
_ZERO_HEADING_REASON = (
    "panoramas whose GPano heading is 0, a usual default, and whose EXIF states another: 0 taken; give a poses file if the "
    "other is right"
)


def check_equirectangular(path: Path) -> None:
    """Raise ValueError or ImageError where a picture is no equirectangular panorama."""
    read_panorama_metadata(path)


def read_panorama_view(path: Path) -> tuple[float, float, float, float] | None:
    """Return the part of the full panorama that a picture of unknown kind shows; None for a photo.

    A picture without GPano tags counts as a panorama by its proportions alone, and may still be a photo.

    Returns
    -------
    (left, top, width, height) as shares.

    Raises
    ------
    ImageError
        Where its tags state another projection, or an impossible part.
    """
    with open_picture(path) as image:
        pano, (width, height) = _gpano_fields(image), image.size
        turned = _is_rotated(image)
    if "ProjectionType" not in pano and (turned or abs(width / height / 2 - 1) > PICTURES.panorama_aspect_tolerance):
        return None
    try:
        return read_panorama_metadata(path)[0]
    except ValueError as error:
        raise ImageError(f"{path.name} {error}") from error


def read_panorama_metadata(path: Path) -> tuple[tuple[float, float, float, float], SourcePose | None, bool, str | None]:
    """Return the view, the pose, whether the heading is from magnetic north, and the date of a picture.

    ValueError with the remedy where the picture is no equirectangular panorama.
    """
    with open_picture(path) as image:
        pano, gps = _gpano_fields(image), read_exif_gps(image)
        width, height = image.size
        turned, taken = _is_rotated(image), exif_capture_date(image)
    view = _gpano_view(pano)
    projection = str(pano.get("ProjectionType", "equirectangular"))
    if projection.lower() != "equirectangular":
        raise ValueError(f"is a {projection} panorama; give equirectangular ones, or remove it")
    if turned:
        raise ValueError("is turned by its EXIF, and a panorama's sky is its first row; save it upright, or remove it")
    full_width, full_height = width / view[2], height / view[3]
    if abs(full_width / full_height / 2 - 1) > PICTURES.panorama_aspect_tolerance:
        whole = "" if view == _FULL_VIEW else f", {full_width:.0f} x {full_height:.0f} uncropped"
        raise ValueError(
            f"is {width} x {height} pixels{whole}, and an equirectangular panorama is twice as wide as high; "
            "give the whole one or its GPano tags, or remove it"
        )
    return view, *embedded_pose(pano, gps), taken


def read_exif_pose(path: Path) -> SourcePose | None:
    """Return the EXIF position of a picture, with the heading if stated.

    None without a position. Headings from magnetic north are taken as true.
    """
    with open_picture(path) as image:
        return embedded_pose({}, read_exif_gps(image))[0]


def embedded_pose(pano: Mapping[str, str], gps: Mapping[str, TagValue]) -> tuple[SourcePose | None, bool]:
    """Return the pose that GPano and GPS tags state, and whether its heading is from magnetic north."""
    try:
        lon = degrees_from_dms(gps["GPSLongitude"], gps.get("GPSLongitudeRef"))
        lat = degrees_from_dms(gps["GPSLatitude"], gps.get("GPSLatitudeRef"))
    except (KeyError, TypeError, ValueError, ArithmeticError):
        return None, False
    if not math.isfinite(lon + lat):
        return None, False
    heading, direction = _finite_number(pano.get("PoseHeadingDegrees")), _finite_number(gps.get("GPSImgDirection"))
    if heading is not None:
        pitch, roll = (_finite_number(pano.get(f"Pose{angle}Degrees")) or 0.0 for angle in ("Pitch", "Roll"))
        doubts = (_ZERO_HEADING_REASON,) if heading == 0 and direction else ()
        return SourcePose(LONLAT, lon, lat, None, heading, pitch, roll, remarks=doubts), False
    reference = gps.get("GPSImgDirectionRef") or "T"
    magnetic = str(reference.decode("ascii", "ignore") if isinstance(reference, bytes) else reference)[:1] in "Mm"
    return SourcePose(LONLAT, lon, lat, None, direction), magnetic


def _finite_number(value: object) -> float | None:
    if not isinstance(value, str | bytes | SupportsFloat):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return number if math.isfinite(number) else None


def _gpano_view(pano: Mapping[str, str]) -> tuple[float, float, float, float]:
    """Return the part (left, top, width, height) of the full panorama as shares; all without GPano.

    ValueError where the part is impossible.
    """

    def pixels(name: str) -> float:
        return _finite_number(pano.get(f"{name}Pixels")) or 0.0

    spans = [
        (pixels(f"FullPano{side}"), pixels(f"CroppedAreaImage{side}"), pixels(f"CroppedArea{edge}"))
        for side, edge in (("Width", "Left"), ("Height", "Top"))
    ]
    if not all(whole and length for whole, length, _ in spans):
        return _FULL_VIEW
    shares = []
    for whole, length, start in spans:
        # writers round, and some start a picture at any column of the circle
        if not (1 <= length <= 1.01 * whole <= PICTURES.max_full_side_px and -whole <= start <= whole):
            raise ValueError(
                f"states by GPano a part of {length:g} pixels at {start:g} of {whole:g}, which is none; mend or remove its XMP"
            )
        shares.append((start / whole, min(length / whole, 1.0)))
    (left, width), (top, height) = shares
    return (left, top, width, height)


def _is_rotated(image: Image) -> bool:
    try:
        return image.getexif().get(_ORIENTATION_TAG, 1) in range(2, 9)
    except Exception:  # damaged EXIF means no rotation
        return False


def read_exif_gps(image: Image) -> dict[str, TagValue]:
    """Return the EXIF GPS tags by name; none where the EXIF is damaged."""
    from PIL.ExifTags import GPSTAGS

    try:
        tags = image.getexif().get_ifd(_GPS_IFD)
        return {GPSTAGS.get(number, str(number)): value for number, value in tags.items()}
    except Exception:  # damaged metadata raises errors of any class
        return {}


def _gpano_fields(image: Image) -> dict[str, str]:
    """Return the GPano fields of the XMP as text by name; none where the XMP is damaged."""
    try:
        waiting: list[object] = [image.getxmp()]
    except Exception:  # damaged metadata raises errors of any class
        return {}
    fields: dict[str, str] = {}
    while waiting:
        node = waiting.pop()
        if isinstance(node, list):
            waiting += node
        elif isinstance(node, dict):
            for name, value in node.items():
                text = value.get("text") if isinstance(value, dict) else value
                if isinstance(text, str):
                    fields.setdefault(name, text.strip())
                waiting.append(value)
    return fields
