"""Cameras around a place, written in every format that is read."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation

from facade_core.core.types import Lens, Pose
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from tests.catalogs.readers.pictures.test_panoramas import dms

UTM = CRS.from_epsg(32632)
ORIGIN = np.array([407_000.0, 5_381_500.0, 150.0])
SIZE = (160, 120)
LENS = Lens(SIZE, (140.0, 141.0), (81.0, 59.0), (-0.1, 0.01), tangential=(0.001, -0.002))
BOUNDS = (ORIGIN[0] - 40, ORIGIN[1] - 40, ORIGIN[0] + 40, ORIGIN[1] + 40)


def ring(count: int = 6, *, lens: Lens = LENS, pitch: float = 3.0) -> dict[str, Pose]:
    """Cameras along a bent street, each with its own rotation."""
    angle = np.linspace(0, 2.2, count)
    return {
        f"{number}.jpg": Pose(
            float(ORIGIN[0] + 30 * np.cos(a)), float(ORIGIN[1] + 30 * np.sin(a)), float(ORIGIN[2] + 2.5 + 0.3 * number),
            float(20 + 71 * number) % 360, pitch + number, 2.0 - number, lens=lens,
        )
        for number, a in enumerate(angle)
    }  # fmt: skip


def write_pictures(
    folder: Path, names: Sequence[str], *, size: tuple[int, int] = SIZE, gps: Mapping[str, Sequence[float]] = {}
) -> Path:
    """Write a picture each, with GPS (lon, lat, altitude) in EXIF where it is given."""
    folder.mkdir(exist_ok=True)
    for number, name in enumerate(names):
        image = Image.fromarray(np.random.default_rng(number).integers(0, 255, (size[1], size[0], 3), np.uint8))
        exif = Image.Exif()
        if name in gps:
            lon, lat, *altitude = gps[name]
            tags = {1: "N", 2: dms(lat), 3: "E", 4: dms(lon)} | ({5: b"\0", 6: altitude[0]} if altitude else {})
            exif.get_ifd(0x8825).update(tags)
        image.save(folder / name, exif=exif)
    return folder


def lonlat(poses: Mapping[str, Pose], noise: float = 0.0) -> dict[str, tuple[float, float, float]]:
    """GPS of poses, off by so many metres."""
    back = Transformer.from_crs(UTM, 4326, always_xy=True)
    rng = np.random.default_rng(1)
    off = {name: rng.normal(0, noise, 3) for name in poses}
    return {
        name: (*back.transform(pose.x + off[name][0], pose.y + off[name][1]), float(pose.z or 0) + off[name][2])
        for name, pose in poses.items()
    }


Similarity = tuple[Rotation, float, np.ndarray]
# A frame of its own: turned, scaled and moved.
LOCAL: Similarity = (Rotation.from_euler("xyz", [100, 20, -50], degrees=True), 0.13, np.array([3.0, -2.0, 1.0]))
SAME: Similarity = (Rotation.identity(), 1.0, np.zeros(3))


def in_frame(pose: Pose, frame: Similarity) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) to camera axes, and centre, in another frame: local = scale R (world - ORIGIN) + shift."""
    turn, scale, shift = frame
    origin = ORIGIN if frame is not SAME else np.zeros(3)
    centre = scale * turn.apply(camera_position(pose) - origin) + shift
    return camera_from_world(pose) @ turn.as_matrix().T, centre


def write_colmap(
    folder: Path,
    poses: Mapping[str, Pose],
    frame: Similarity = LOCAL,
    *,
    binary: bool = False,
    order: str = "wxyz",
    models: Sequence[tuple[str, list[float]]] | None = None,
) -> Path:
    """Write a model, with a camera a picture where `models` are given, and 60 points that the pictures show."""
    folder.mkdir(exist_ok=True)
    models = models or [("OPENCV", [140, 141, 81, 59, -0.1, 0.01, 0.001, -0.002])]
    numbers = {
        "SIMPLE_PINHOLE": 0,
        "PINHOLE": 1,
        "SIMPLE_RADIAL": 2,
        "RADIAL": 3,
        "OPENCV": 4,
        "OPENCV_FISHEYE": 5,
        "FULL_OPENCV": 6,
    }
    rows = []
    points = []
    for number, (name, pose) in enumerate(poses.items()):
        rotation, centre = in_frame(pose, frame)
        x, y, z, w = Rotation.from_matrix(rotation).as_quat()
        quaternion = [dict(w=w, x=x, y=y, z=z)[one] for one in order]
        rows.append((number + 1, quaternion, -rotation @ centre, number % len(models) + 1, name))
        rng = np.random.default_rng(number)
        ahead = rng.uniform([-0.3, -0.2, 1], [0.3, 0.2, 1], (20, 3)) * rng.uniform(5, 20, (20, 1)) * frame[1]
        points += [(centre + rotation.T @ one, number + 1) for one in ahead]
    if not binary:
        cameras = [
            f"{n} {m} {SIZE[0]} {SIZE[1]} {' '.join(map(repr, map(float, p)))}" for n, (m, p) in enumerate(models, 1)
        ]
        (folder / "cameras.txt").write_text("# Camera list\n" + "\n".join(cameras) + "\n")
        lines = [
            f"{n} {' '.join(repr(float(v)) for v in (*q, *t))} {c} {name}\n{'1.0 2.0 -1' if n % 2 else ''}\n"
            for n, q, t, c, name in rows
        ]
        (folder / "images.txt").write_text("# Image list\n" + "".join(lines))
        (folder / "points3D.txt").write_text(
            "".join(
                f"{i} {p[0]!r} {p[1]!r} {p[2]!r} 1 2 3 0.5 {n} 0\n"
                for i, (p, n) in enumerate((list(map(float, p)), n) for p, n in points)
            )
        )
        return folder / "images.txt"
    content = struct.pack("<Q", len(models))
    for n, (model, parameters) in enumerate(models, 1):
        content += struct.pack(f"<iiQQ{len(parameters)}d", n, numbers[model], *SIZE, *parameters)
    (folder / "cameras.bin").write_bytes(content)
    content = struct.pack("<Q", len(rows))
    for n, q, t, c, name in rows:
        content += struct.pack("<i7di", n, *q, *t, c) + name.encode() + b"\0" + struct.pack("<Q", 2) + bytes(48)
    (folder / "images.bin").write_bytes(content)
    content = struct.pack("<Q", len(points))
    for i, (p, n) in enumerate(points):
        content += struct.pack("<Q3d3BdQii", i, *p, 1, 2, 3, 0.5, 1, n, 0)
    (folder / "points3D.bin").write_bytes(content)
    return folder


def write_opensfm(path: Path, poses: Mapping[str, Pose], *, reference: bool = True) -> Path:
    """Write a reconstruction east, north and up of a place, or in a frame of its own."""
    longest = max(SIZE)
    camera = {
        "projection_type": "brown", "width": SIZE[0], "height": SIZE[1], "focal_x": 140 / longest, "focal_y": 141 / longest,
        "c_x": (81 - SIZE[0] / 2) / longest, "c_y": (59 - SIZE[1] / 2) / longest,
        "k1": -0.1, "k2": 0.01, "p1": 0.001, "p2": -0.002, "k3": 0.0,
    }  # fmt: skip
    lon, lat = Transformer.from_crs(UTM, 4326, always_xy=True).transform(*ORIGIN[:2])
    shots = {}
    for name, pose in poses.items():
        rotation, centre = (topocentric(pose, lon, lat)) if reference else in_frame(pose, LOCAL)
        shots[name] = {
            "camera": "c", "rotation": Rotation.from_matrix(rotation).as_rotvec().tolist(),
            "translation": (-rotation @ centre).tolist(),
        }  # fmt: skip
    part = {"cameras": {"c": camera}, "shots": shots}
    if reference:
        part["reference_lla"] = {"longitude": lon, "latitude": lat, "altitude": 150.0}
    path.write_text(json.dumps([part]))
    return path


def ecef_axes(lon: float, lat: float) -> np.ndarray:
    """East, north and up (3, 3) as rows, geocentric."""
    a, p = np.radians([lon, lat])
    return np.array([
        [-np.sin(a), np.cos(a), 0], [-np.sin(p) * np.cos(a), -np.sin(p) * np.sin(a), np.cos(p)],
        [np.cos(p) * np.cos(a), np.cos(p) * np.sin(a), np.sin(p)],
    ])  # fmt: skip


def geocentric(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and centre of a pose in geocentric axes: grid north is turned from true north."""
    from pyproj import Proj

    lon, lat = Transformer.from_crs(UTM, 4326, always_xy=True).transform(pose.x, pose.y)
    convergence = Proj(UTM).get_factors(lon, lat).meridian_convergence
    true = replace(pose, heading=pose.heading + convergence)
    centre = Transformer.from_crs(4979, 4978, always_xy=True).transform(lon, lat, pose.z)
    return camera_from_world(true) @ ecef_axes(lon, lat), np.array(centre)


def topocentric(pose: Pose, lon: float, lat: float) -> tuple[np.ndarray, np.ndarray]:
    """The same, east, north and up of a place 150 m over the ellipsoid."""
    rotation, centre = geocentric(pose)
    axes = ecef_axes(lon, lat)
    origin = np.array(Transformer.from_crs(4979, 4978, always_xy=True).transform(lon, lat, 150.0))
    return rotation @ axes.T, axes @ (centre - origin)


def write_metashape(
    path: Path, poses: Mapping[str, Pose], *, mirror: bool = False, placed: bool = True, in_component: bool = False
) -> Path:
    """Write an export of cameras in a chunk's own frame, with its transform to the earth, of Metashape 2 in a component."""
    chunk = np.eye(4)
    turn = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    first = geocentric(next(iter(poses.values())))[1]
    chunk[:3, :3], chunk[:3, 3] = 2.5 * turn, first + np.full(3, 5.0)
    cameras = []
    for number, (name, pose) in enumerate(poses.items()):
        rotation, centre = geocentric(pose)
        matrix = np.eye(4)
        matrix[:3, :3] = turn.T @ rotation.T @ np.diag([-1.0 if mirror else 1.0, 1, 1])
        matrix[:3, 3] = turn.T @ (centre - chunk[:3, 3]) / 2.5
        text = " ".join(repr(float(v)) for v in matrix.ravel())
        cameras.append(
            f'<camera id="{number}" sensor_id="0" component_id="0" label="{Path(name).stem}">'
            f"<transform>{text}</transform></camera>"
        )
    numbers = [" ".join(repr(float(v)) for v in one) for one in (turn.ravel(), chunk[:3, 3])]
    parts = f"<rotation>{numbers[0]}</rotation><translation>{numbers[1]}</translation><scale>2.5</scale>"
    transform = f"<transform>{parts}</transform>"
    if in_component:
        transform = f'<components><component id="0">{transform}</component><component id="1"/></components>'
    path.write_text(
        f"""<?xml version="1.0" encoding="UTF-8"?><document version="2.0.0"><chunk label="c">
<sensors><sensor id="0" type="frame">
<resolution width="{SIZE[0]}" height="{SIZE[1]}"/><calibration type="frame" class="adjusted">
<resolution width="{SIZE[0]}" height="{SIZE[1]}"/><f>141</f><b1>-1</b1><cx>{81 - SIZE[0] / 2}</cx><cy>{59 - SIZE[1] / 2}</cy>
<k1>-0.1</k1><k2>0.01</k2><p1>-0.002</p1><p2>0.001</p2></calibration></sensor></sensors>
<cameras>{"".join(cameras)}<camera id="99" sensor_id="0" label="lost"/></cameras>{transform if placed else ""}
<reference>{CRS.from_epsg(4326).to_wkt("WKT1_GDAL").replace('"', "&quot;")}</reference></chunk></document>"""
    )
    return path
