"""One file per facade: a zip with a JSON header, the bare wall and each group's principal components as WebP.

The header holds integers (boxes, quantised coordinates and light, types, structure matrices as run lengths) and the scale
of each axis, so the file needs neither pickle nor this package's classes to be understood.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Sequence

import numpy as np

from facade_core.errors import InputError
from facade_core.variation.appearance import Basis
from facade_core.variation.contents import Contents, Group, Level

_FORMAT = "streetloom variation 2"
_WALL_QUALITY = 50
_BASIS_QUALITY = 65
# Coordinates are kept to half a grey level per value, light to 1/128.
_COORDINATE_STEP = 0.5
_LIGHT_STEP = 1 / 128


def quantise_light(light: np.ndarray) -> np.ndarray:
    """The light as the file keeps it."""
    return np.round(light / _LIGHT_STEP) * _LIGHT_STEP


def code_basis(basis: Basis) -> tuple[bytes, list[float]]:
    """WebP of the mean and the axes one below the other, and the largest magnitude of each axis."""
    scales = np.abs(basis.axes).max(axis=(1, 2, 3)).astype(float)
    axes = 128 + 127 * basis.axes / np.maximum(scales, 1e-12)[:, None, None, None]
    stack = np.concatenate([basis.mean[None], axes]).clip(0, 255).round().astype(np.uint8)
    return _webp(stack.reshape(-1, *stack.shape[2:]), _BASIS_QUALITY), [round(s, 6) for s in scales.tolist()]


def decode_basis(coded: bytes, scales: Sequence[float]) -> Basis:
    """The basis that a file's reader sees."""
    image = _pixels(coded).astype(np.float32)
    stack = image.reshape(1 + len(scales), -1, *image.shape[1:])
    return Basis(stack[0], (stack[1:] - 128) / 127 * np.array(scales, np.float32)[:, None, None, None])


def encode_file(
    wall: np.ndarray,
    groups: Sequence[Group],
    bases: Sequence[tuple[bytes, list[float]]],
    cells: Sequence[np.ndarray],
    representatives: np.ndarray,
    levels: Sequence[Sequence[np.ndarray]],
) -> bytes:
    """The file's bytes; groups hold what `decode_basis` of their coded basis gives; levels: matrices per grid."""
    header = {
        "format": _FORMAT,
        "groups": [
            {
                "label": g.label,
                "boxes": g.boxes.tolist(),
                "light": np.round(g.light / _LIGHT_STEP).astype(int).tolist(),
                "coordinates": np.round(g.coordinates / _step(g.basis)).astype(int).tolist(),
                "types": g.types.tolist(),
                "scales": scales,
            }
            for g, (_, scales) in zip(groups, bases, strict=True)
        ],
        "cells": [c.tolist() for c in cells],
        "representatives": representatives.tolist(),
        "levels": [[_runs(m) for m in matrices] for matrices in levels],
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:

        def put(name: str, content: bytes, method: int) -> None:
            archive.writestr(zipfile.ZipInfo(name), content, method)

        put("header.json", json.dumps(header, separators=(",", ":")).encode(), zipfile.ZIP_DEFLATED)
        put("wall.webp", _webp(wall, _WALL_QUALITY), zipfile.ZIP_STORED)
        for k, (coded, _) in enumerate(bases):
            put(f"group{k}.webp", coded, zipfile.ZIP_STORED)
    return out.getvalue()


def decode(coded: bytes) -> Contents:
    """What is in a file's bytes; InputError when they are no such file or damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(coded)) as archive:
            header = json.loads(archive.read("header.json"))
            if header["format"] != _FORMAT:
                raise InputError(f"variation file: format {header['format']!r} is not {_FORMAT!r}; encode it again")
            wall = _pixels(archive.read("wall.webp"))
            groups = [_group(g, archive.read(f"group{k}.webp")) for k, g in enumerate(header["groups"])]
        cells = tuple(np.array(c, np.int32) for c in header["cells"])
        representatives = np.array(header["representatives"], np.int32)
        types = np.concatenate([g.types for g in groups]) if groups else np.zeros(0, np.int32)
        matrices = [
            tuple(_unrolled(m, c.shape) for m, c in zip(level, cells, strict=True)) for level in header["levels"]
        ]
        levels = tuple(_level(m, cells, types, len(representatives)) for m in matrices)
    except (zipfile.BadZipFile, OSError, KeyError, TypeError, ValueError, IndexError, EOFError) as error:
        raise InputError("variation file: damaged or something else; encode the facade again") from error
    return Contents(levels, wall, tuple(groups), cells, representatives)


def _runs(labels: np.ndarray) -> list[int]:
    """A label map as run lengths in reading order: label, length, label, length ..."""
    flat = labels.ravel()
    starts = np.flatnonzero(np.diff(flat, prepend=flat[0] - 1))
    return np.stack([flat[starts], np.diff(starts, append=len(flat))], axis=1).ravel().tolist()


def _unrolled(runs: Sequence[int], shape: tuple[int, ...]) -> np.ndarray:
    return np.repeat(np.array(runs[::2], np.int32), runs[1::2]).reshape(shape)


def _group(header: dict, coded: bytes) -> Group:
    basis = decode_basis(coded, header["scales"])
    number = len(header["boxes"])
    return Group(
        header["label"],
        basis,
        np.array(header["boxes"], np.int32).reshape(number, 4),
        np.array(header["light"], float) * _LIGHT_STEP,
        np.array(header["coordinates"], float).reshape(number, len(header["scales"])) * _step(basis),
        np.array(header["types"], np.int32),
    )


def _level(grids: tuple[np.ndarray, ...], cells: tuple[np.ndarray, ...], types: np.ndarray, number: int) -> Level:
    pairs = np.zeros((number, number))
    for grid, cell in zip(grids, cells, strict=True):
        used = cell >= 0
        np.add.at(pairs, (types[cell[used]], grid[used]), 1)
    counts = pairs.sum(axis=0).astype(np.int32)
    return Level(grids, counts, pairs / np.maximum(pairs.sum(axis=1, keepdims=True), 1))


def _step(basis: Basis) -> float:
    # Axes have unit length, so a coordinate is a root mean square intensity times the root of the number of values.
    return _COORDINATE_STEP * float(np.sqrt(basis.mean.size))


def _webp(image: np.ndarray, quality: int) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(image).save(out, "WEBP", quality=quality, method=4)
    return out.getvalue()


def _pixels(coded: bytes) -> np.ndarray:
    from PIL import Image

    with Image.open(io.BytesIO(coded), formats=["WEBP"]) as image:
        return np.asarray(image.convert("RGB"))
