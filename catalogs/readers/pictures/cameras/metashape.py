"""Reader of cameras that Agisoft Metashape exports as XML."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import partial
from typing import TypeAlias
from xml.etree.ElementTree import Element

import numpy as np

from catalogs.crs import LONLAT, parse_crs
from catalogs.features import Remark
from catalogs.reader_errors import short_message, to_single_line, wrap_reader_errors
from catalogs.readers.pictures.cameras.camera_file import (
    CameraFile,
    SourceCamera,
    ToLonLat,
    build_camera,
    check_lens,
    check_position,
    check_rotation,
)
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.types import Lens

_PANORAMA_REASON = "spherical cameras of {file} left out; give their poses under imagery.panoramas"
_DISABLED_REASON = "cameras of {file} that are disabled in Metashape left out"
_ONE_LABEL_REASON = "is of several cameras of one label; give them, or their sensors, different labels in Metashape"
_UNPLACED_REASON = (
    "cameras of {file} taken where the first camera of their system is, as their sensor states no location; adjust the "
    "offsets of the sensors in Metashape, where they are apart"
)
_UNALIGNED_REASON = "cameras of {file} without a transform left out: Metashape did not align them"
# Matrix (4, 4) to the world and that world's conversion, by component.
_Frames: TypeAlias = Mapping[str | None, tuple[Float64Array, ToLonLat | None]]


def read_metashape(name: str, text: bytes) -> CameraFile:
    """Read the cameras of all chunks.

    Raises
    ------
    InputError
        Where the file is none, has no camera, or chunks in frames of their own.
    """
    from defusedxml import ElementTree

    with wrap_reader_errors(name, "is no XML that can be read", "export the cameras again"):
        root = ElementTree.fromstring(text)
    chunks = root.findall(".//chunk[cameras]")
    if root.tag != "document" or not chunks:
        raise InputError(f"{name} is no export of Metashape; export the cameras as Agisoft XML (*.xml)")
    cameras: dict[str, SourceCamera | str] = {}
    remarks: list[Remark] = []
    places = []
    for chunk in chunks:
        frames = _component_frames(name, chunk)
        found = _chunk_cameras(name, chunk, frames, remarks)
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


def _chunk_cameras(name: str, chunk: Element, frames: _Frames, remarks: list[Remark]) -> dict[str, SourceCamera | str]:
    """Return the cameras of a chunk with the frames of its components."""
    sensors = {one.get("id"): one for one in chunk.iter("sensor")}
    lenses = {id: _sensor_lens(one) for id, one in sensors.items()}
    cameras = {one.get("id"): one for one in chunk.iter("camera")}
    repeated = Counter(one.get("label") for one in cameras.values())
    found: dict[str, SourceCamera | str] = {}
    for one in cameras.values():
        label = one.get("label")
        if not label:
            continue
        sensor = sensors.get(one.get("sensor_id"))
        if repeated[label] > 1 and sensor is not None:  # pictures of a rig, in a folder for each sensor
            label = f"{sensor.get('label')}/{label}"
        if label in found:
            found[label] = _ONE_LABEL_REASON
            continue
        lens = lenses.get(one.get("sensor_id"), "its sensor is not listed")
        leader = one if one.find("transform") is not None else cameras.get(one.get("master_id"), one)
        if leader.find("transform") is None:
            reason = _UNALIGNED_REASON
        elif one.get("enabled") in ("false", "0"):
            reason = _DISABLED_REASON
        elif lens is None:
            reason = _PANORAMA_REASON
        else:
            found[label] = build_camera(name, label, lens, partial(_pose, one, leader, sensor, frames))
            if leader is one or (sensor is not None and sensor.find("location") is not None):
                continue
            reason = _UNPLACED_REASON
        remarks.append(Remark(to_single_line(label[:80]), reason.format(file=name), None))
    return found


def _pose(
    camera: Element, leader: Element, sensor: Element | None, frames: _Frames
) -> tuple[Float64Array, Float64Array]:
    """Return position and rotation of a camera, by that of the leader of its rig and the sensor's place beside it."""
    component = leader.get("component_id") if len(frames) > 1 else None
    if component not in frames:
        raise ValueError("its component has no transform, so it has no place beside the others")
    placed = frames[component][0] @ _numbers(leader.findtext("transform"), 16).reshape(4, 4)
    if leader is not camera and sensor is not None:
        beside = np.eye(4)
        beside[:3, :3] = _numbers(sensor.findtext("rotation") or "1 0 0 0 1 0 0 0 1", 9).reshape(3, 3)
        beside[:3, 3] = _numbers(sensor.findtext("location") or "0 0 0", 3)
        placed = placed @ beside
    scale = np.cbrt(abs(np.linalg.det(placed[:3, :3])))
    rotation = check_rotation(placed[:3, :3].T / max(float(scale), 1e-12))
    return check_position(placed[:3, 3]), rotation


def _component_frames(name: str, chunk: Element) -> _Frames:
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
    calibration = min(known, key=lambda one: one.get("class") != "adjusted", default=None)
    if calibration is None:
        return "its sensor has no calibration; align the pictures in Metashape, and export again"
    kind = calibration.get("type") or sensor.get("type") or "frame"
    if kind not in ("frame", "fisheye"):
        return f"its sensor type {kind[:40]} is not read; undistort the pictures in Metashape, and give these"
    try:
        return _calibrated_lens(calibration, sensor, is_fisheye=kind == "fisheye")
    except (ValueError, OverflowError) as error:
        return short_message(error)


def _calibrated_lens(calibration: Element, sensor: Element, *, is_fisheye: bool) -> Lens:
    """Return the lens of a calibration; ValueError for one that is not read."""
    size = next((one for part in (calibration, sensor) for one in part.findall("resolution")), None)
    if size is None:
        raise ValueError("its sensor states no resolution")

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
