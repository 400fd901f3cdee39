"""Street panoramas and where they were taken: equirectangular pictures posed by a poses file or by their own metadata."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalogs.broken import single_line, fault_reason
from catalogs.features import Fault, Remark
from catalogs.file_digest import file_digest
from catalogs.readers.pictures.days import day_taken
from catalogs.readers.pictures.folders import image_files
from catalogs.readers.pictures.opening import opened
from catalogs.readers.pictures.poses import LONLAT, SourcePose, dms_degrees, implausible, read_poses
from facade_core.core.errors import InputError
from facade_core.core.types import Pose

if TYPE_CHECKING:
    from PIL.Image import Image
    from pyproj import CRS, Transformer

# A panorama farther than this from the buildings shows none of them at a useful size.
FAR_M = 1000.0
# A full panorama is twice as wide as high; stitchers round sides to multiples of up to 32 pixels.
ASPECT_TOLERANCE = 0.02
_GPS_IFD, _ORIENTATION = 0x8825, 0x0112
# Pictures of one place, metres, taken more than so many days apart may show two states of a street.
NEAR_M, APART_DAYS = 30.0, 400
# Pixels of a full panorama: no more are told apart.
_WIDEST = 1e6
_FULL = (0.0, 0.0, 1.0, 1.0)
_OLDER = (
    "panoramas taken more than a year before others beside them; `changed` tells of facades, ground shows all of them"
)


@dataclass(frozen=True, slots=True)
class PosedPanorama:
    """An equirectangular picture and its pose in the block's frame; id is the file's name without suffix. captured: the day,
    by its entry in the poses file, else by its EXIF; None where neither tells a day."""

    id: str
    path: Path
    pose: Pose
    captured: str | None = None


@dataclass(frozen=True, slots=True)
class Panoramas:
    """The posed pictures of a folder by name, those that are broken, and what the reader says of some."""

    items: tuple[PosedPanorama, ...]
    faults: tuple[Fault, ...] = ()
    remarks: tuple[Remark, ...] = ()


def read_panoramas(
    folder: Path, poses: Path | None, crs: CRS, bounds: tuple[float, float, float, float] | None = None
) -> Panoramas:
    """The posed panoramas of a folder, in the block's frame `crs`.

    A picture's pose is the first that is found with place and heading: in the poses file (formats: read_poses), in GPano XMP
    with EXIF GPS, in EXIF GPS alone. Headings from true north become grid headings. z is None unless the poses file gives one:
    the height in a picture's GPS has another datum. The part of the full panorama that the picture holds is from GPano XMP.
    Pictures more than FAR_M outside `bounds` (xmin, ymin, xmax, ymax in metres) are skipped with a remark. Pictures that are
    unreadable, not equirectangular, without a pose or given twice become faults; of those taken long before others beside them
    it is said. Raises InputError when no picture has a pose.
    """
    paths, unreadable = image_files(folder, "panorama")
    sources = read_poses(poses) if poses else {}
    faults, remarks, items = list(unreadable), [], []
    frames: dict[str | None, Transformer] = {}
    known: dict[str, Path] = {}
    same_size: dict[int, list[Path]] = {}
    posed = 0
    for path in paths:
        first = known.setdefault(path.stem, path)
        if first != path:
            reason = f"{path.name} and {first.name} have one name; rename or remove one"
            faults.append(Fault(path.name, "panorama", reason))
            continue
        try:
            view, source, magnetic, taken = _metadata(path)
            source = _named(sources, path) or source
            if source is None or source.heading is None:
                raise ValueError(_unposed(source, poses))
            pose = in_frame(source, view, crs, frames)
        except ValueError as error:
            faults.append(Fault(path.name, "panorama", single_line(str(error))))
            continue
        except Exception as error:  # what a header or a pose can hold, libraries meet with errors of every kind
            faults.append(Fault(path.name, "panorama", fault_reason(error, "mend its pose, or remove it")))
            continue
        posed += 1
        if not math.isfinite(pose.x + pose.y) or (bounds and _outside(pose, bounds) > FAR_M):
            remarks.append(Remark(path.stem, "panoramas of another place skipped", None))
            continue
        alike = same_size.setdefault(path.stat().st_size, [])
        if twin := next((one for one in alike if file_digest(one) == file_digest(path)), None):
            faults.append(
                Fault(path.name, "panorama", f"is the same picture as {twin.name}; remove one, or mend its file")
            )
            continue
        alike.append(path)
        if magnetic and _named(sources, path) is None:
            remarks.append(Remark(path.stem, "panoramas whose heading from magnetic north is taken as true", None))
        items.append(PosedPanorama(path.stem, path, pose, source.captured or taken))
    if not posed:
        remedy = "; ".join(f"{fault.id}: {fault.reason}" for fault in faults[:3])
        raise InputError(f"{folder} holds no panorama that can be used: {remedy}")
    if poses and not any(_entry(sources, path) for path in paths):
        example = next(iter(sources))
        reason = f"none of the pictures it names (e.g. {example}) is in {folder}; name files as they are there"
        faults.append(Fault(poses.name, "panorama", f"{poses.name}: {reason}"))
    return Panoramas(tuple(items), tuple(faults), (*remarks, *_apart(items)))


def _apart(items: Sequence[PosedPanorama]) -> list[Remark]:
    """The panoramas that were taken long before another one beside them."""
    import shapely

    dated = [(one, day) for one in items if (day := _day(one.captured))]
    if not dated:
        return []
    places = shapely.points([(one.pose.x, one.pose.y) for one, _ in dated])
    newest: dict[int, int] = {}  # beside each
    for first, second in shapely.STRtree(places).query(places, predicate="dwithin", distance=NEAR_M).T.tolist():
        if dated[second][1] > dated[newest.get(first, first)][1]:
            newest[first] = second
    found = []
    for first, second in sorted(newest.items()):
        (older, before), (newer, after) = dated[first], dated[second]
        if (after - before).days > APART_DAYS:
            found.append(Remark(f"{older.id} of {before} near {newer.id} of {after}", _OLDER, None))
    return found


def _day(text: str | None) -> date | None:
    try:
        return date.fromisoformat(text[:10]) if text else None
    except ValueError:
        return None


def _entry(sources: Mapping[str, SourcePose | str], path: Path) -> SourcePose | str | None:
    return sources.get(path.name) or sources.get(path.stem)


def _named(sources: Mapping[str, SourcePose | str], path: Path) -> SourcePose | None:
    """The pose of a picture in the poses file, where that states a heading; ValueError where the entry is broken."""
    found = _entry(sources, path)
    if isinstance(found, str):
        raise ValueError(found)
    return found if found and found.heading is not None else None


def _unposed(source: SourcePose | None, poses: Path | None) -> str:
    lacking = "no pose" if source is None else "a place but no heading"
    return f"{lacking}; give its pose in {poses.name if poses else 'a poses file'}, or remove it"


def _outside(pose: Pose, bounds: Sequence[float]) -> float:
    xmin, ymin, xmax, ymax = bounds
    return math.hypot(max(xmin - pose.x, 0.0, pose.x - xmax), max(ymin - pose.y, 0.0, pose.y - ymax))


def in_frame(
    source: SourcePose, view: tuple[float, float, float, float], crs: CRS, frames: dict[str | None, Transformer]
) -> Pose:
    """A pose in the block's frame: its north, true or of its grid, turns with the frame."""
    from pyproj import CRS, Transformer

    if problem := implausible(source):
        raise ValueError(f"{problem}; mend its pose")
    origin = CRS.from_user_input(source.crs) if source.crs else crs
    if source.crs not in frames:
        frames[source.crs] = Transformer.from_crs(origin, crs, always_xy=True)
    transformer = frames[source.crs]
    if origin.is_geographic and not (abs(source.x) <= 360.0 and abs(source.y) <= 90.0):
        raise ValueError(f"no place on earth is at longitude {source.x:g}, latitude {source.y:g}; mend its pose")
    step = -1e-3 if source.y > 0 else 1e-3  # towards the equator, so that no pole is crossed
    if not origin.is_geographic:
        step = 100.0
    x, y = transformer.transform(source.x, source.y)
    x_off, y_off = transformer.transform(source.x, source.y + step)
    across = math.cos(math.radians(y)) if crs.is_geographic else 1.0  # a degree of longitude over one of latitude
    east, up = (x_off - x) * across, y_off - y
    north = math.degrees(math.atan2(east * step, up * step)) if math.isfinite(x_off + y_off) else 0.0
    heading = (float(source.heading or 0.0) + north) % 360.0
    return Pose(float(x), float(y), source.z, heading, source.pitch, source.roll, view)


def check_equirectangular(path: Path) -> None:
    """ValueError, or ImageError, where a picture is no equirectangular panorama by what it says and by its shape, with
    the remedy."""
    _metadata(path)


def _metadata(path: Path) -> tuple[tuple[float, float, float, float], SourcePose | None, bool, str | None]:
    """What a picture says of itself: its view, its pose, whether its heading is from magnetic north, and its day.

    ValueError where it is not an equirectangular panorama, with the remedy.
    """
    with opened(path) as image:
        pano, gps = _gpano(image), _gps(image)
        width, height = image.size
        turned, taken = _turned(image), day_taken(image)
    view = _view(pano)
    projection = str(pano.get("ProjectionType", "equirectangular"))
    if projection.lower() != "equirectangular":
        raise ValueError(f"is a {projection} panorama; give equirectangular ones, or remove it")
    if turned:
        raise ValueError("is turned by its EXIF, and a panorama's sky is its first row; save it upright, or remove it")
    full_width, full_height = width / view[2], height / view[3]
    if abs(full_width / full_height / 2 - 1) > ASPECT_TOLERANCE:
        whole = "" if view == _FULL else f", {full_width:.0f} x {full_height:.0f} uncropped"
        raise ValueError(
            f"is {width} x {height} pixels{whole}, and an equirectangular panorama is twice as wide as high; "
            "give the whole one or its GPano tags, or remove it"
        )
    return view, *_own_pose(pano, gps), taken


def stated_place(path: Path) -> SourcePose | None:
    """Where a picture of any kind was taken by its EXIF, and its heading where that tells it; None without a place. Headings
    from magnetic north are taken as true."""
    with opened(path) as image:
        return _own_pose({}, _gps(image))[0]


def _own_pose(pano: Mapping[str, str], gps: Mapping[str, Any]) -> tuple[SourcePose | None, bool]:
    try:
        lon = dms_degrees(gps["GPSLongitude"], gps.get("GPSLongitudeRef"))
        lat = dms_degrees(gps["GPSLatitude"], gps.get("GPSLatitudeRef"))
    except (KeyError, TypeError, ValueError, ArithmeticError):
        return None, False
    if not math.isfinite(lon + lat):
        return None, False
    heading = _finite(pano.get("PoseHeadingDegrees"))
    if heading is not None:
        pitch, roll = (_finite(pano.get(f"Pose{angle}Degrees")) or 0.0 for angle in ("Pitch", "Roll"))
        return SourcePose(LONLAT, lon, lat, None, heading, pitch, roll), False
    reference = gps.get("GPSImgDirectionRef") or "T"
    magnetic = str(reference.decode("ascii", "ignore") if isinstance(reference, bytes) else reference)[:1] in "Mm"
    return SourcePose(LONLAT, lon, lat, None, _finite(gps.get("GPSImgDirection"))), magnetic


def _finite(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return number if math.isfinite(number) else None


def _view(pano: Mapping[str, str]) -> tuple[float, float, float, float]:
    """The picture's part of the full panorama, (left, top, width, height) as shares; all of it where GPano does not say.

    ValueError where what it says is no part of a panorama.
    """
    full = [_finite(pano.get(f"FullPano{side}Pixels")) for side in ("Width", "Height")]
    part = [_finite(pano.get(f"CroppedAreaImage{side}Pixels")) for side in ("Width", "Height")]
    corner = [_finite(pano.get(f"CroppedArea{side}Pixels")) or 0.0 for side in ("Left", "Top")]
    if any(value is None or value == 0 for value in (*full, *part)):
        return _FULL
    shares = []
    for whole, length, start in zip(full, part, corner, strict=True):
        assert whole
        assert length
        # writers round, and some let the picture begin at any column of the full circle
        if not (1 <= length <= 1.01 * whole <= _WIDEST and -whole <= start <= whole):
            raise ValueError(
                f"states by GPano a part of {length:g} pixels at {start:g} of {whole:g}, which is none; mend or remove its XMP"
            )
        shares.append((start / whole, min(length / whole, 1.0)))
    (left, width), (top, height) = shares
    return (left, top, width, height)


def _turned(image: Image) -> bool:
    try:
        return image.getexif().get(_ORIENTATION, 1) in range(2, 9)
    except Exception:  # an EXIF block that is damaged turns nothing
        return False


def _gps(image: Image) -> dict[str, Any]:
    """EXIF GPS tags by name; none where the EXIF block is damaged."""
    from PIL.ExifTags import GPSTAGS

    try:
        tags = image.getexif().get_ifd(_GPS_IFD)
        return {GPSTAGS.get(number, str(number)): value for number, value in tags.items()}
    except Exception:  # damaged in any way
        return {}


def _gpano(image: Image) -> dict[str, str]:
    """The GPano fields of the picture's XMP, as text by name; none where the XMP is damaged."""
    try:
        waiting: list[Any] = [image.getxmp()]
    except Exception:  # damaged in any way
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
