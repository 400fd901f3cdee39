"""Reader of COLMAP models, text and binary: cameras and images."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import partial
from io import BufferedReader
from pathlib import Path

import numpy as np

from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.pictures.cameras.camera_file import (
    CameraFile,
    SourceCamera,
    build_camera,
    check_lens,
    check_position,
    rotation_from_quaternion,
)
from catalogs.readers.settings import CAMERAS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular
from facade_core.core.types import Lens

# Models of COLMAP by number: names, and how many parameters they have.
MODELS = {
    0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 2: ("SIMPLE_RADIAL", 4), 3: ("RADIAL", 5), 4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8), 6: ("FULL_OPENCV", 12), 7: ("FOV", 5), 8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5), 10: ("THIN_PRISM_FISHEYE", 12), 11: ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
}  # fmt: skip
PARAMETERS = dict(MODELS.values())
_POINT_BYTES = 24


def read_colmap(path: Path) -> CameraFile:
    """Read a COLMAP model, named by its folder or by one of its files.

    Raises
    ------
    InputError
        Where a file of the model is missing, or is no such file.
    """
    folder = path if path.is_dir() else path.parent
    is_text = path.suffix != ".bin" if path.is_file() else (folder / "images.txt").is_file()
    suffix, read_lenses, read_images = (
        (".txt", _text_lenses, _text_images) if is_text else (".bin", _binary_lenses, _binary_images)
    )
    files = [folder / f"{part}{suffix}" for part in ("cameras", "images")]
    for file in files:
        if not file.is_file():
            models = sorted(one.parent for one in folder.glob("*/images.*"))
            remedy = f"did you mean {models[0]}?" if models else f"a COLMAP model has it beside {files[0].name}"
            raise InputError(f"{file} is missing; {remedy}")
    with (
        wrap_reader_errors(files[0], "is not COLMAP's", "export the model again"),
        open_regular(files[0], CAMERAS.max_cameras_bytes) as stream,
    ):
        lenses = dict(read_lenses(stream))
    cameras: dict[str, SourceCamera | str] = {}
    with (
        wrap_reader_errors(files[1], "is not COLMAP's", "export the model again"),
        open_regular(files[1], CAMERAS.max_images_bytes) as stream,
    ):
        for _, values, camera, name in read_images(stream):
            if len(cameras) >= CAMERAS.max_images:
                raise ValueError(f"it has more than {CAMERAS.max_images} pictures")
            lens = lenses.get(camera, "its camera is not listed")
            cameras[name] = build_camera(files[1].name, name, lens, partial(_pose, values))
    return CameraFile(files[1].name, cameras, is_local=True)


def _pose(values: list[float]) -> tuple[Float64Array, Float64Array]:
    rotation = rotation_from_quaternion(*values[:4])
    return check_position(-rotation.T @ np.array(values[4:])), rotation


def _lens(model: str, width: int, height: int, values: list[float]) -> Lens | str:
    """Return the lens of COLMAP's parameters, or why it is not read."""
    if model not in PARAMETERS:
        return f"its camera model {model[:40]} is unknown"
    if len(values) != PARAMETERS[model]:
        return f"its camera {model} has {len(values)} parameters, and {PARAMETERS[model]} are needed"
    if "PRISM" in model or model == "FOV":
        return f"its camera model {model} is not read; run colmap image_undistorter, and give its model and pictures"
    size = (width, height)
    focals = 2 if model in ("PINHOLE", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV") else 1
    focal = (values[0], values[focals - 1])
    centre, rest = (values[focals], values[focals + 1]), tuple(values[focals + 2 :])
    fisheye = model.endswith("FISHEYE")
    radial, tangential = rest, (0.0, 0.0)
    denominator: tuple[float, ...] = ()
    if model in ("OPENCV", "FULL_OPENCV"):
        radial, tangential = (*rest[:2], *rest[4:5]), (rest[2], rest[3])
        denominator = rest[5:]
    try:
        return check_lens(Lens(size, focal, centre, radial, denominator, tangential, fisheye=fisheye))
    except ValueError as error:
        return str(error)


def _text_lines(stream: BufferedReader) -> Iterator[str]:
    """Yield the lines without comments, empty ones too; the first 200 bytes decide whether it is text."""
    if b"\0" in stream.peek(200)[:200]:
        raise ValueError("it is no text")
    while line := stream.readline(CAMERAS.max_line_bytes):
        if not line.endswith(b"\n") and len(line) >= CAMERAS.max_line_bytes:
            raise ValueError("it has a line without end")
        if not line.startswith(b"#"):
            yield line.decode(errors="replace").strip()


def _text_lenses(stream: BufferedReader) -> Iterator[tuple[int, Lens | str]]:
    for line in _text_lines(stream):
        if line:
            number, model, width, height, *values = line.split()
            yield int(number), _lens(model, int(width), int(height), [float(value) for value in values])


def _text_images(stream: BufferedReader) -> Iterator[tuple[int, list[float], int, str]]:
    lines = _text_lines(stream)
    for line in lines:
        if not line:
            continue
        number, *values, camera, name = line.split(maxsplit=9)
        if len(values) != 7:
            raise ValueError("a line of a picture has too few numbers")
        next(lines, "")  # its points
        yield int(number), [float(value) for value in values], int(camera), name


def _unpack(stream: BufferedReader, form: str) -> tuple[float, ...]:
    size = struct.calcsize(f"<{form}")
    return struct.unpack(f"<{form}", stream.read(size))


def _binary_lenses(stream: BufferedReader) -> Iterator[tuple[int, Lens | str]]:
    (count,) = _unpack(stream, "Q")
    for _ in range(int(count)):
        number, model, width, height = _unpack(stream, "iiQQ")
        if model not in MODELS:
            raise ValueError(f"camera model {model} is unknown")
        name, parameters = MODELS[int(model)]
        yield int(number), _lens(name, int(width), int(height), list(_unpack(stream, f"{parameters}d")))


def _binary_images(stream: BufferedReader) -> Iterator[tuple[int, list[float], int, str]]:
    (count,) = _unpack(stream, "Q")
    for _ in range(int(count)):
        number, *values, camera = _unpack(stream, "i7di")
        name = bytearray()
        while (octet := stream.read(1)) != b"\0":
            if not octet or len(name) > CAMERAS.max_name_bytes:
                raise ValueError("it is truncated")
            name += octet
        (points,) = _unpack(stream, "Q")
        stream.seek(int(points) * _POINT_BYTES, 1)
        yield int(number), list(values), int(camera), name.decode(errors="replace")
