"""File format of a variation hierarchy: a zip with a JSON header and the photo as AVIF.

The header holds integers (boxes, quantised light, types, structure matrices as run lengths), so that readers need
neither pickle nor this package's classes.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Sequence

import numpy as np

from facade_core.core.arrays import Int32Array, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from facade_core.facade.variation.contents import ElementGroup, HierarchyContents, VariationLevel

_FORMAT = "streetloom variation 3"
# About half of a JPEG's bytes at the same similarity; one thread, so that bits do not depend on the machine.
AVIF_OPTIONS = {"quality": 45, "speed": 8, "max_threads": 1}
# Quantisation step of light.
_LIGHT_STEP = 1 / 128


def encode_hierarchy_file(
    photo: UInt8Array,
    groups: Sequence[ElementGroup],
    cells: Sequence[Int32Array],
    representatives: Int32Array,
    levels: Sequence[Sequence[Int32Array]],
) -> bytes:
    """Encode a variation hierarchy as the bytes of its file.

    Parameters
    ----------
    photo : (H, W, 3) uint8.
    groups : elements by label and size.
    cells : per grid, element numbers, -1 for none.
    representatives : (T,) element number of each type.
    levels : per level, one structure matrix for each grid.
    """
    header = {
        "format": _FORMAT,
        "groups": [
            {
                "label": g.label,
                "boxes": g.boxes.tolist(),
                "light": np.round(g.light / _LIGHT_STEP).astype(int).tolist(),
                "types": g.types.tolist(),
            }
            for g in groups
        ],
        "cells": [c.tolist() for c in cells],
        "representatives": representatives.tolist(),
        "levels": [[_run_lengths(m) for m in matrices] for matrices in levels],
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        text = json.dumps(header, separators=(",", ":")).encode()
        archive.writestr(zipfile.ZipInfo("header.json"), text, zipfile.ZIP_DEFLATED, 9)
        archive.writestr(zipfile.ZipInfo("photo.avif"), _encode_avif(photo), zipfile.ZIP_STORED)
    return out.getvalue()


def decode_hierarchy_file(coded: bytes) -> HierarchyContents:
    """Decode the bytes of a hierarchy file.

    Raises
    ------
    InputError
        If the bytes are damaged, of another kind, or of an earlier format.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(coded)) as archive:
            header = json.loads(archive.read("header.json"))
            if header["format"] != _FORMAT:
                raise InputError(
                    f"variation file: format {header['format']!r} is not {_FORMAT!r}; encode the facade again, "
                    "as a run of this version does"
                )
            photo = _decode_avif(archive.read("photo.avif"))
        groups = [_read_group(g) for g in header["groups"]]
        cells = tuple(np.array(c, np.int32) for c in header["cells"])
        representatives = np.array(header["representatives"], np.int32)
        types = np.concatenate([g.types for g in groups]) if groups else np.zeros(0, np.int32)
        matrices = [
            tuple(_expand_runs(m, c.shape) for m, c in zip(level, cells, strict=True)) for level in header["levels"]
        ]
        levels = tuple(_build_level(m, cells, types, len(representatives)) for m in matrices)
    except (zipfile.BadZipFile, OSError, KeyError, TypeError, ValueError, IndexError, EOFError) as error:
        raise InputError("variation file: damaged or something else; encode the facade again") from error
    return HierarchyContents(levels, photo, tuple(groups), cells, representatives)


def _run_lengths(labels: Int32Array) -> list[int]:
    """Return a label map as run lengths in reading order: label, length, label, length ..."""
    flat = labels.ravel()
    starts = np.flatnonzero(np.diff(flat, prepend=flat[0] - 1))
    return np.stack([flat[starts], np.diff(starts, append=len(flat))], axis=1).ravel().tolist()


def _expand_runs(runs: Sequence[int], shape: tuple[int, ...]) -> Int32Array:
    return np.repeat(np.array(runs[::2], np.int32), runs[1::2]).reshape(shape)


def _read_group(header: JsonObject) -> ElementGroup:
    number = len(header["boxes"])
    return ElementGroup(
        header["label"],
        np.array(header["boxes"], np.int32).reshape(number, 4),
        np.array(header["light"], float) * _LIGHT_STEP,
        np.array(header["types"], np.int32),
    )


def _build_level(
    grids: tuple[Int32Array, ...], cells: tuple[Int32Array, ...], types: Int32Array, number: int
) -> VariationLevel:
    pairs = np.zeros((number, number))
    for grid, cell in zip(grids, cells, strict=True):
        used = cell >= 0
        np.add.at(pairs, (types[cell[used]], grid[used]), 1)
    counts = pairs.sum(axis=0).astype(np.int32)
    return VariationLevel(grids, counts, pairs / np.maximum(pairs.sum(axis=1, keepdims=True), 1))


def _encode_avif(image: UInt8Array) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(image).save(out, "AVIF", **AVIF_OPTIONS)
    return out.getvalue()


def _decode_avif(coded: bytes) -> UInt8Array:
    from PIL import Image

    with Image.open(io.BytesIO(coded), formats=["AVIF"]) as image:
        return np.asarray(image.convert("RGB"))
