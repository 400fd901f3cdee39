"""Reader of cameras that Agisoft Metashape exports as XML."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from catalogs.crs import LONLAT, parse_crs
from catalogs.features import Remark
from catalogs.reader_errors import short_message, to_single_line
from catalogs.readers.pictures.cameras.camera_file import (
    CameraFile,
    SourceCamera,
    ToLonLat,
    check_lens,
    check_position,
    check_rotation,
)
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.types import Lens

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_PANORAMA_REASON = "spherical cameras of {file} left out; give their poses under imagery.panoramas"
_DISABLED_REASON = "cameras of {file} that are disabled in Metashape left out"
_UNALIGNED_REASON = "cameras of {file} without a transform left out: Metashape did not align them"


def read_metashape(name: str, text: bytes) -> CameraFile:
    """Read the cameras of all chunks.

    Raises
    ------
    InputError
        Where the file is none, has no camera, or chunks in frames of their own.
    """
    from defusedxml import DefusedXmlException, ElementTree

    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, DefusedXmlException, ValueError, LookupError) as error:
        raise InputError(
            f"{name} is no XML that can be read ({short_message(error)}); export the cameras again"
        ) from error
    chunks = [one for one in root.iter("chunk") if one.find("cameras") is not None]
    if root.tag != "document" or not chunks:
        raise InputError(f"{name} is no export of Metashape; export the cameras as Agisoft XML (*.xml)")
    cameras: dict[str, SourceCamera | str] = {}
    remarks: list[Remark] = []
    places = []
    for chunk in chunks:
        frames = _component_frames(name, chunk)
        found = _chunk_cameras(name, chunk, {id: frame[0] for id, frame in frames.items()}, remarks)
        if found:
            cameras |= found
            places.append(frames[None][1])
    if not cameras:
        raise InputError(f"{name} holds no aligned camera; align the pictures in Metashape, and export again")
    if None in places and len(places) > 1:
        raise InputError(
            f"{name} holds {len(places)} chunks, one without a place on earth; export the one of the block"
        )
    lonlat = places[0]
    return CameraFile(name, cameras, is_local=lonlat is None, to_lonlat=lonlat, remarks=tuple(remarks))


def _chunk_cameras(
    name: str, chunk: Element, matrices: Mapping[str | None, Float64Array], remarks: list[Remark]
) -> dict[str, SourceCamera | str]:
    """Return the cameras of a chunk; matrices (4, 4) to the world by component, None for cameras without one."""
    lenses = {one.get("id"): _sensor_lens(one) for one in chunk.iter("sensor")}
    found: dict[str, SourceCamera | str] = {}
    for one in chunk.iter("camera"):
        label = one.get("label") or ""
        if not label or one.find("transform") is None:
            if label:
                remarks.append(Remark(to_single_line(label[:80]), _UNALIGNED_REASON.format(file=name), None))
            continue
        if one.get("enabled") in ("false", "0"):
            remarks.append(Remark(to_single_line(label[:80]), _DISABLED_REASON.format(file=name), None))
            continue
        lens = lenses.get(one.get("sensor_id"), "its sensor is not listed")
        if lens is None:
            remarks.append(Remark(to_single_line(label[:80]), _PANORAMA_REASON.format(file=name), None))
            continue
        try:
            if isinstance(lens, str):
                raise ValueError(lens)
            component = one.get("component_id") if len(matrices) > 1 else None
            if component not in matrices:
                raise ValueError("its component has no transform, so it has no place beside the others")
            placed = matrices[component] @ _numbers(one.findtext("transform"), 16).reshape(4, 4)
            scale = np.cbrt(abs(np.linalg.det(placed[:3, :3])))
            rotation = check_rotation(placed[:3, :3].T / max(float(scale), 1e-12))
            centre = check_position(placed[:3, 3])
        except (ValueError, TypeError) as error:
            found[label] = f"{name}: {to_single_line(label[:80])}: {short_message(error)}; mend that entry"
        else:
            found[label] = SourceCamera(centre, rotation, lambda _, lens=lens: lens)  # type: ignore[misc]
    return found


def _component_frames(name: str, chunk: Element) -> dict[str | None, tuple[Float64Array, ToLonLat | None]]:
    """Return the frames of the components of a chunk, of Metashape 2, and under None that of the chunk itself."""
    parts = [one for one in chunk.findall("components/component") if one.find("transform") is not None]
    found = {one.get("id"): _frame(name, one.find("transform"), chunk) for one in parts}
    own = next(iter(found.values())) if found else _frame(name, chunk.find("transform"), chunk)
    return {**found, None: own}


def _frame(name: str, transform: Element | None, chunk: Element) -> tuple[Float64Array, ToLonLat | None]:
    """Return the matrix (4, 4) of a transform to its world, and that world's conversion; None for one without a place."""
    matrix = np.eye(4)
    if transform is None:
        return matrix, None
    try:
        scale = float(transform.findtext("scale") or 1.0)
        matrix[:3, :3] = scale * _numbers(transform.findtext("rotation") or "1 0 0 0 1 0 0 0 1", 9).reshape(3, 3)
        matrix[:3, 3] = _numbers(transform.findtext("translation") or "0 0 0", 3)
    except ValueError as error:
        raise InputError(
            f"{name}: the transform of its chunk is none ({short_message(error)}); export it again"
        ) from error
    if np.linalg.det(matrix[:3, :3]) <= 0:
        raise InputError(f"{name}: the transform of its chunk mirrors (left-handed axes); export right-handed ones")
    reference = (chunk.findtext("reference") or "").strip()
    if not reference or reference.startswith(("LOCAL_CS", "ENGCRS", "ENGINEERINGCRS")):
        return matrix, None
    return matrix, _geocentric_to_lonlat(name, reference)


def _geocentric_to_lonlat(name: str, reference: str) -> ToLonLat:
    """Return the conversion of geocentric positions on the datum of a reference."""
    from pyproj import Transformer

    try:
        geodetic = parse_crs(reference).geodetic_crs
    except InputError as error:
        raise InputError(f"{name}: its reference {error}") from error
    ellipsoid = None if geodetic is None else geodetic.ellipsoid
    if geodetic is None or ellipsoid is None:
        raise InputError(f"{name}: its reference has no ellipsoid; export the cameras in WGS 84")
    to_degrees = Transformer.from_pipeline(
        f"+proj=pipeline +step +inv +proj=cart +a={ellipsoid.semi_major_metre} +b={ellipsoid.semi_minor_metre}"
        " +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )
    to_wgs84 = Transformer.from_crs(geodetic.to_2d(), LONLAT, always_xy=True)

    def convert(points: Float64Array) -> Float64Array:
        lon, lat, height = to_degrees.transform(points[:, 0], points[:, 1], points[:, 2])
        east, north = to_wgs84.transform(lon, lat)
        return np.stack([east, north, height], axis=1)

    return convert


def _numbers(text: str | None, count: int) -> Float64Array:
    values = np.array((text or "").split(), np.float64)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ValueError(f"a matrix has {len(values)} finite numbers, and {count} are needed")
    return values


def _sensor_lens(sensor: Element) -> Lens | str | None:
    """Return the lens of a sensor, why it has none, or None for a spherical one."""
    if sensor.get("type") == "spherical":
        return None
    known = [one for one in sensor.iter("calibration") if one.find("f") is not None or one.find("fx") is not None]
    calibration = next((one for one in known if one.get("class") == "adjusted"), known[0] if known else None)
    if calibration is None:
        return "its sensor has no calibration; align the pictures in Metashape, and export again"
    kind = calibration.get("type") or sensor.get("type") or "frame"
    if kind not in ("frame", "fisheye"):
        return f"its sensor type {kind[:40]} is not read; undistort the pictures in Metashape, and give these"
    size = calibration.find("resolution")
    size = sensor.find("resolution") if size is None else size
    try:
        if size is None:
            raise ValueError("its sensor states no resolution")
        return _calibrated_lens(calibration, size, is_fisheye=kind == "fisheye")
    except (ValueError, OverflowError) as error:
        return short_message(error)


def _calibrated_lens(calibration: Element, size: Element, *, is_fisheye: bool) -> Lens:
    """Return the lens of a calibration; ValueError for one that is not read."""

    def value(tag: str) -> float:
        return float(calibration.findtext(tag) or "0")

    if value("p3") or value("p4"):
        raise ValueError("its distortion has P3 and P4, which are not read; optimise the cameras without them")
    width, height = int(size.get("width", "0")), int(size.get("height", "0"))
    if calibration.find("f") is not None:
        focal = (value("f") + value("b1"), value("f"))
        centre = (width / 2 + value("cx"), height / 2 + value("cy"))
        skew = value("b2")
    else:  # files of before 1.2 count the principal point from the corner
        focal, centre, skew = (value("fx"), value("fy")), (value("cx"), value("cy")), value("skew")
    radial = tuple(value(f"k{i}") for i in range(1, 5))
    # Metashape's P1 belongs to x, OpenCV's p1 to y
    tangential = (value("p2"), value("p1"))
    return check_lens(Lens((width, height), focal, centre, radial, (), tangential, skew, fisheye=is_fisheye))
