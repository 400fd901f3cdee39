"""What pictures state of themselves in GPano and EXIF tags: the part of a panorama, place and heading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.crs import LONLAT
from catalogs.readers.pictures.capture_dates import exif_capture_date
from catalogs.readers.pictures.decoding import open_picture
from catalogs.readers.pictures.source_poses import SourcePose, TagValue, degrees_from_dms
from catalogs.readers.referenced_files import find_in_other_form
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import ImageError, InputError
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from PIL.Image import Image

_GPS_IFD = 0x8825
_ORIENTATION_TAG = 0x0112
_FULL_VIEW = (0.0, 0.0, 1.0, 1.0)
_MAGNETIC_REASON = "panoramas whose heading from magnetic north is taken as true"
_NO_NUMBER_REASON = "panoramas whose GPano {name} is no number: read without"
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
        pano, (width, height) = _xmp_fields(path, image), image.size
        turned = _is_rotated(image)
    if "ProjectionType" not in pano and (turned or abs(width / height / 2 - 1) > PICTURES.panorama_aspect_tolerance):
        return None
    try:
        return read_panorama_metadata(path)[0]
    except ValueError as error:
        raise ImageError(f"{path.name} {error}") from error


def read_panorama_metadata(path: Path) -> tuple[tuple[float, float, float, float], dict[str, SourcePose], str | None]:
    """Return the view, what each source states of the pose, and the date of a picture.

    ValueError with the remedy where the picture is no equirectangular panorama.
    """
    with open_picture(path) as image:
        pano, gps = _xmp_fields(path, image), read_exif_gps(image)
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
    return view, stated_poses(pano, gps), taken


def read_stated_poses(path: Path) -> dict[str, SourcePose]:
    """Return what a picture states of its pose, by source: XMP, whose sidecar counts first, and EXIF.

    Headings from magnetic north are taken as true, with a remark.
    """
    with open_picture(path) as image:
        return stated_poses(_xmp_fields(path, image), read_exif_gps(image))


def stated_poses(xmp: Mapping[str, str], gps: Mapping[str, TagValue]) -> dict[str, SourcePose]:
    """Return what the fields of XMP and the GPS tags of EXIF state of a pose, by source."""
    names = {key: f"Pose{key.title()}Degrees" for key in ("heading", "pitch", "roll")}
    heading, pitch, roll = (_tag_number(xmp, name) for name in names.values())
    direction = _tag_number(gps, "GPSImgDirection")
    doubts = [
        (key, _NO_NUMBER_REASON.format(name=name))
        for key, name in names.items()
        if xmp.get(name) and _tag_number(xmp, name) is None
    ]
    if heading == 0 and direction:
        doubts.append(("heading", _ZERO_HEADING_REASON))
    if heading is None and (heading := _tag_number(xmp, "GPSImgDirection")) is not None:
        doubts += _magnetic_doubts(xmp)
    (lon, lat), (exif_lon, exif_lat) = _lonlat(xmp), _lonlat(gps)
    return {
        "XMP": SourcePose(LONLAT, lon, lat, None, heading, pitch, roll, remarks=tuple(doubts)),
        "EXIF": SourcePose(LONLAT, exif_lon, exif_lat, None, direction, remarks=_magnetic_doubts(gps)),
    }


def _lonlat(tags: Mapping[str, TagValue]) -> tuple[float, float] | tuple[None, None]:
    """Return longitude and latitude of GPS tags; XMP writes them as "60,9.585N"."""
    try:
        lon, lat = (
            degrees_from_dms([_number(part) for part in value[:-1].split(",")], value[-1])
            if isinstance(value := tags[key], str)
            else degrees_from_dms(value, tags.get(f"{key}Ref"))
            for key in ("GPSLongitude", "GPSLatitude")
        )
    except (KeyError, TypeError, ValueError, ArithmeticError, IndexError):
        return None, None
    return (lon, lat) if math.isfinite(lon + lat) else (None, None)


def _tag_number(tags: Mapping[str, TagValue], name: str) -> float | None:
    try:
        number = _number(tags[name])
    except (KeyError, TypeError, ValueError, ArithmeticError):
        return None
    return number if math.isfinite(number) else None


def _number(value: TagValue) -> float:
    """Return the number of a tag; XMP writes fractions as "2705/10", and some writers a decimal comma."""
    if not isinstance(value, str):
        return float(value)  # type: ignore[arg-type]
    number, _, divisor = value.replace(",", ".").partition("/")
    return float(number) / float(divisor or 1)


def _magnetic_doubts(tags: Mapping[str, TagValue]) -> tuple[tuple[str, str], ...]:
    reference = tags.get("GPSImgDirectionRef") or "T"
    letter = str(reference.decode("ascii", "ignore") if isinstance(reference, bytes) else reference)[:1]
    return (("heading", _MAGNETIC_REASON),) if letter in "Mm" and letter else ()


def _gpano_view(pano: Mapping[str, str]) -> tuple[float, float, float, float]:
    """Return the part (left, top, width, height) of the full panorama as shares; all without GPano.

    ValueError where the part is impossible.
    """

    def pixels(name: str) -> float:
        return _tag_number(pano, f"{name}Pixels") or 0.0

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


def _xmp_fields(path: Path, image: Image) -> dict[str, str]:
    """Return the fields of a picture's XMP as text by name, those of a sidecar NAME.xmp or NAME.jpg.xmp first."""
    from PIL import Image as PillowImage

    fields: dict[str, str] = {}
    for name in (f"{path.name}.xmp", f"{path.stem}.xmp"):
        beside = find_in_other_form(path.with_name(name), fold_case=True)
        if beside is None:
            continue
        with suppress(OSError, InputError), open_regular(beside, PICTURES.max_sidecar_bytes) as sidecar:
            carrier = PillowImage.new("L", (1, 1))
            carrier.info["xmp"] = sidecar.read()
            fields = _parse_xmp(carrier) | fields
    return _parse_xmp(image) | fields


def _parse_xmp(image: Image) -> dict[str, str]:
    """Return the fields of the XMP as text by name; none where the XMP is damaged."""
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
