"""Street panoramas: equirectangular pictures with poses from a poses file or from their metadata."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from catalogs.crs import LONLAT
from catalogs.features import Fault, Remark
from catalogs.file_digest import file_digest
from catalogs.printable_text import format_unit_reason
from catalogs.reader_errors import fault_reason, to_single_line
from catalogs.readers.pictures.embedded_poses import read_panorama_metadata
from catalogs.readers.pictures.folders import list_images
from catalogs.readers.pictures.picture_matches import picture_id, select_entries
from catalogs.readers.pictures.poses import PosesFile, read_poses_file
from catalogs.readers.pictures.source_poses import SourcePose, assemble_pose, find_implausible_value, is_on_earth
from catalogs.readers.settings import PICTURES
from facade_core.core.errors import InputError
from facade_core.core.types import Pose

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

_OUTDATED_REASON = (
    "panoramas taken more than a year before others beside them; `changed` tells of facades, ground shows all of them "
    "(imagery.panoramas.since leaves old ones out)"
)
_TILT_REASON = (
    "panoramas that {source} tilts by over 45 degrees; pitch is 0 at the horizon (Metashape counts from straight down), roll 0 "
    "upright"
)
_DISTANT_REASON = (
    "panoramas skipped that lie far from the buildings; check the order of x and y (east first), of lon and lat, "
    "and the crs"
)


@dataclass(frozen=True, slots=True)
class PosedPanorama:
    """Equirectangular picture with its pose in the frame of a block.

    Attributes
    ----------
    id : path in the folder without suffix, as left-0000.
    path : file.
    pose : camera pose.
    captured : date in the poses file, else in EXIF; None without one.
    """

    id: str
    path: Path
    pose: Pose
    captured: str | None = None


@dataclass(frozen=True, slots=True)
class PosedPanoramas:
    """Posed panoramas of a folder by name, with faults and remarks."""

    items: tuple[PosedPanorama, ...]
    faults: tuple[Fault, ...] = ()
    remarks: tuple[Remark, ...] = ()


def read_panoramas(
    folder: Path,
    poses: Path | None,
    crs: CRS,
    bounds: tuple[float, float, float, float] | None = None,
    since: str | None = None,
) -> PosedPanoramas:
    """Read the posed panoramas of a folder in the frame of a block.

    Each field of a pose is from the first that states it of: the poses file, XMP (its sidecar first), EXIF. Pitch and roll
    that none states are 0. Headings from true north become grid headings. z is None unless the poses file states it, since
    GPS heights have another datum. GPano XMP states the part of the full panorama. Panoramas farther than
    PICTURES.max_panorama_distance_m outside the bounds are skipped with a remark.
    Panoramas much older than a nearby one get a remark.

    Parameters
    ----------
    folder : folder of pictures.
    poses : poses file in a format of read_poses_file, or None.
    crs : frame of the block.
    bounds : (xmin, ymin, xmax, ymax) in the frame, metres; None for no limit.
    since : day such as "2023-05-01"; panoramas captured before it are left out with a remark, those without a date are kept.

    Returns
    -------
    Panoramas; unreadable pictures, other projections, missing poses and duplicates are faults.

    Raises
    ------
    InputError
        Where no picture has a pose.
    """
    paths, unreadable = list_images(folder, "panorama", with_subfolders=True)
    stated = read_poses_file(poses) if poses else PosesFile({})
    entries = {} if poses is None else select_entries(stated.poses, poses.name, folder, paths)
    reader = _PanoramaReader(folder, poses, entries, crs, bounds)
    reader.faults += unreadable
    reader.remarks += stated.remarks
    for path in paths:
        try:
            reader.read(path)
        except Exception as error:  # libraries raise errors of any class
            reader.faults.append(panorama_fault(path, error, "mend its pose, or remove it"))
    faults, items = reader.faults, reader.items
    if not reader.posed:
        remedy = "; ".join(format_unit_reason(fault.id, fault.reason) for fault in faults[:3])
        raise InputError(f"{folder} holds no panorama that can be used: {remedy}")
    if poses and not entries:
        example = next(iter(stated.poses))
        reason = f"none of the pictures it names (e.g. {example}) is in {folder}; name files as they are there"
        faults.append(Fault(poses.name, "panorama", f"{poses.name}: {reason}"))
    if first_day := _parse_date(since):
        items, remarks = _leave_out_older(items, first_day)
        reader.remarks += remarks
    return PosedPanoramas(tuple(items), tuple(faults), (*reader.remarks, *outdated_remarks(items)))


def _leave_out_older(items: Sequence[PosedPanorama], first_day: date) -> tuple[list[PosedPanorama], list[Remark]]:
    older = {one.id for one in items if (day := _parse_date(one.captured)) and day < first_day}
    remarks = [Remark(id, f"panoramas from before {first_day} left out", None) for id in sorted(older)]
    return [one for one in items if one.id not in older], remarks


def panorama_fault(path: Path, error: Exception, remedy: str) -> Fault:
    """Return the fault of a picture that cannot be used; a ValueError states its remedy itself."""
    is_stated = isinstance(error, ValueError)
    return Fault(path.name, "panorama", to_single_line(str(error)) if is_stated else fault_reason(error, remedy))


class _PanoramaReader:
    """Panoramas of a folder so far, with their faults and remarks."""

    def __init__(
        self,
        folder: Path,
        poses: Path | None,
        entries: Mapping[Path, SourcePose | str],
        crs: CRS,
        bounds: tuple[float, float, float, float] | None,
    ) -> None:
        self.folder, self.poses, self.entries, self._crs, self._bounds = folder, poses, entries, crs, bounds
        self.items: list[PosedPanorama] = []
        self.faults: list[Fault] = []
        self.remarks: list[Remark] = []
        self.posed = 0
        self._frames: dict[str | None, Transformer] = {}
        self._known: dict[str, Path] = {}
        self._same_size: dict[int, list[Path]] = {}

    def read(self, path: Path) -> None:
        """Read one picture; ValueError where it cannot be used."""
        id = picture_id(path, self.folder)
        first = self._known.setdefault(id, path)
        if first != path:
            raise ValueError(f"{path.name} and {first.name} have one name; rename or remove one")
        view, embedded, taken = read_panorama_metadata(path)
        entry = self.entries.get(path)
        if isinstance(entry, str):
            raise ValueError(entry)
        stated = {} if self.poses is None or entry is None else {self.poses.name: entry}
        source, origins = assemble_pose(stated | embedded)
        if source.x is None or source.heading is None:
            raise ValueError(_missing_pose_reason(source, self.poses, entry))
        pose = project_pose(source, view, self._crs, self._frames)
        self.posed += 1
        if is_distant(pose, self._bounds):
            self.remarks.append(Remark(id, _DISTANT_REASON, None))
            return
        self._check_twin(path)
        reasons = [*(reason for _, reason in source.remarks), *_mixed_source_reasons(origins, has_file=bool(stated))]
        tilts = [key for key in ("pitch", "roll") if abs(getattr(source, key) or 0.0) > PICTURES.max_panorama_tilt_deg]
        reasons += sorted({_TILT_REASON.format(source=origins[key]) for key in tilts})
        self.remarks += [Remark(id, reason, None) for reason in reasons]
        self.items.append(PosedPanorama(id, path, pose, source.captured or taken))

    def _check_twin(self, path: Path) -> None:
        alike = self._same_size.setdefault(path.stat().st_size, [])
        if twin := next((one for one in alike if file_digest(one) == file_digest(path)), None):
            raise ValueError(f"is the same picture as {twin.name}; remove one, or mend its file")
        alike.append(path)


def outdated_remarks(items: Sequence[PosedPanorama]) -> list[Remark]:
    """Return remarks on panoramas that are much older than a nearby one."""
    import shapely

    dated = [(one, day) for one in items if (day := _parse_date(one.captured))]
    if not dated:
        return []
    places = shapely.points([(one.pose.x, one.pose.y) for one, _ in dated])
    newest: dict[int, int] = {}  # newest neighbour of each
    for first, second in (
        shapely.STRtree(places).query(places, predicate="dwithin", distance=PICTURES.nearby_panorama_m).T.tolist()
    ):
        if dated[second][1] > dated[newest.get(first, first)][1]:
            newest[first] = second
    found = []
    for first, second in sorted(newest.items()):
        (older, before), (newer, after) = dated[first], dated[second]
        if (after - before).days > PICTURES.max_age_gap_days:
            found.append(Remark(f"{older.id} of {before} near {newer.id} of {after}", _OUTDATED_REASON, None))
    return found


def _parse_date(text: str | None) -> date | None:
    try:
        return date.fromisoformat(text[:10]) if text else None
    except ValueError:
        return None


def _mixed_source_reasons(origins: Mapping[str, str], *, has_file: bool) -> list[str]:
    """Return the reason of a remark on a pose of several sources; a place of EXIF beside angles of XMP is usual."""
    fields: dict[str, list[str]] = {}
    for key in ("x", "heading", "pitch", "roll") if has_file else ("heading", "pitch", "roll"):
        if key in origins:
            fields.setdefault(origins[key], []).append("place" if key == "x" else key)
    parts = [f"{', '.join(keys)} from {origin}" for origin, keys in fields.items()]
    return [f"panoramas posed by several sources: {'; '.join(parts)}"] if len(parts) > 1 else []


def _missing_pose_reason(source: SourcePose, poses: Path | None, entry: SourcePose | None) -> str:
    if poses is not None and entry is not None:
        present, lacking = ("no place", "place") if source.x is None else ("its place but no heading", "heading")
        return f"{poses.name} states {present}; add its {lacking} there, or remove it"
    lacking = "no pose" if source.x is None else "a place but no heading"
    return f"{lacking}; give its pose in {poses.name if poses else 'a poses file'}, or remove it"


def is_distant(pose: Pose, bounds: tuple[float, float, float, float] | None) -> bool:
    """Return True for a pose of an unknown place, or too far from bounds, if any."""
    if not math.isfinite(pose.x + pose.y):
        return True
    return bounds is not None and distance_outside(pose, bounds) > PICTURES.max_panorama_distance_m


def distance_outside(pose: Pose, bounds: Sequence[float]) -> float:
    """Return the distance of a pose from bounds (xmin, ymin, xmax, ymax), metres, 0 inside."""
    xmin, ymin, xmax, ymax = bounds
    return math.hypot(max(xmin - pose.x, 0.0, pose.x - xmax), max(ymin - pose.y, 0.0, pose.y - ymax))


def project_pose(
    source: SourcePose, view: tuple[float, float, float, float], crs: CRS, transformers: dict[str | None, Transformer]
) -> Pose:
    """Project a pose into the frame of a block.

    North, true or of a grid, turns with the frame.

    Parameters
    ----------
    source : pose in its own coordinate system.
    view : part of the full panorama, (left, top, width, height) as shares.
    crs : frame of the block.
    transformers : cache of transformers by coordinate system.

    Raises
    ------
    ValueError
        For an impossible position.
    """
    from pyproj import CRS, Transformer

    if problem := find_implausible_value(source):
        raise ValueError(f"{problem}; mend its pose")
    if source.x is None or source.y is None:
        raise ValueError("has no place; add it to its pose")
    for name in (source.crs, LONLAT):
        if name not in transformers:
            transformers[name] = Transformer.from_crs(CRS.from_user_input(name) if name else crs, crs, always_xy=True)
    transformer = transformers[source.crs]
    if _is_geographic(source.crs, crs) and not is_on_earth(source.x, source.y):
        raise ValueError(f"no place on earth is at longitude {source.x:g}, latitude {source.y:g}; mend its pose")
    x, y = transformer.transform(source.x, source.y)
    place, north_crs = (source.x, source.y), source.crs
    if source.has_true_heading and not _is_geographic(source.crs, crs):
        place, north_crs = transformers[LONLAT].transform(x, y, direction="INVERSE"), LONLAT
    step = 100.0
    if _is_geographic(north_crs, crs):
        step = -1e-3 if place[1] > 0 else 1e-3  # towards the equator, so that no pole is crossed
    heading = ((source.heading or 0.0) + _source_north(place, transformers[north_crs], step, crs)) % 360.0
    return Pose(float(x), float(y), source.z, heading, source.pitch or 0.0, source.roll or 0.0, view)


def _is_geographic(name: str | None, crs: CRS) -> bool:
    from pyproj import CRS

    return bool((CRS.from_user_input(name) if name else crs).is_geographic)


def _source_north(place: tuple[float, float], transformer: Transformer, step: float, crs: CRS) -> float:
    """Return the direction in the frame, degrees clockwise from up, of a step north from a place of another system."""
    x, y = transformer.transform(*place)
    x_off, y_off = transformer.transform(place[0], place[1] + step)
    across = math.cos(math.radians(y)) if crs.is_geographic else 1.0  # a degree of longitude over one of latitude
    east, up = (x_off - x) * across, y_off - y
    return math.degrees(math.atan2(east * step, up * step)) if math.isfinite(x_off + y_off) else 0.0
