"""The paper's own file of a facade (AlSisan & Mitra 2012, section 4), beside which ours is measured: the wall, the dominant PCA
axes of each group of elements, and per element its coordinates, box, light and type, with the matrices of every level."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from PIL import Image

from facade_core.facade.variation.appearance import PRINCIPAL_COMPONENTS
from facade_core.facade.variation.contents import ElementGroup
from facade_core.facade.variation.element_types import fill_unknown_from_similar
from facade_core.facade.variation.patches import bare_wall, box_mask, cut_patches, patch_size
from facade_core.facade.variation.rendering import drawing_depth, element_boxes, fade_patch, order_by_depth
from facade_core.facade.variation.variations import Variations

# What the wall and the axes are coded with, and the step of coordinates in grey levels a value.
_WALL_QUALITY, _BASIS_QUALITY, _STEP = 50, 65, 0.5


class PapersFile(NamedTuple):
    """A file, and the picture (H, W, 3) uint8 that its reader sees at level 0."""

    coded: bytes
    shown: np.ndarray


def papers_file(image: np.ndarray, of: Variations) -> PapersFile:
    """Of a facade whose variations are known."""
    wall, wall_file = _webp(bare_wall(image, box_mask(element_boxes(of.groups), image.shape[:2])), _WALL_QUALITY)
    files, headers, shown = [wall_file], [], {}
    for group, first in order_by_depth(of.groups):
        patches, basis, header = _group(image, group, of.groups)
        files.append(basis)
        headers.append(header)
        shown[first] = patches
    header = {
        "groups": headers,
        "cells": [c.tolist() for c in of.cells],
        "representatives": of.representatives.tolist(),
        "levels": [[m.tolist() for m in matrices] for matrices in of.levels],
    }
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        text = json.dumps(header, separators=(",", ":"))
        archive.writestr(zipfile.ZipInfo("header.json"), text, zipfile.ZIP_DEFLATED, 9)
        for k, content in enumerate(files):
            archive.writestr(zipfile.ZipInfo(f"{k}.webp"), content, zipfile.ZIP_STORED)
    canvas = wall.astype(np.float32)
    for group, first in order_by_depth(of.groups):
        for box, patch, light in zip(group.boxes.tolist(), shown[first], group.light, strict=True):
            fade_patch(canvas, patch * np.float32(light), box)
    return PapersFile(out.getvalue(), np.clip(canvas.round(), 0, 255).astype(np.uint8))


def _group(
    image: np.ndarray, group: ElementGroup, groups: Sequence[ElementGroup]
) -> tuple[np.ndarray, bytes, dict[str, object]]:
    """A group's patches as a reader sees them, (N, h, w, 3) float32; its axes as a file; the rest."""
    size = patch_size(group.boxes)
    front = [g.boxes for g in groups if drawing_depth(g.label) > drawing_depth(group.label)]
    in_front = box_mask(np.concatenate(front) if front else np.zeros((0, 4), int), image.shape[:2])
    seen = cut_patches(in_front.astype(np.float32), group.boxes, size) < 0.5
    even = cut_patches(image, group.boxes, size) / group.light[:, None, None, None].astype(np.float32)
    patches = fill_unknown_from_similar(np.asarray(even, np.float32), seen)
    flat = patches.reshape(len(patches), -1).astype(np.float64)
    mean = flat.mean(axis=0)
    _, strength, axes = np.linalg.svd(flat - mean, full_matrices=False)
    # Less than half a grey level per value is not worth an axis.
    axes = axes[: min(PRINCIPAL_COMPONENTS, len(flat) - 1)][
        strength[: min(PRINCIPAL_COMPONENTS, len(flat) - 1)] ** 2 > 0.25 * flat.shape[1]
    ]
    scale = np.abs(axes).max(axis=1, initial=1e-12)[:, None]
    stack = np.concatenate([mean[None], 128 + 127 * axes / scale]).clip(0, 255).round().astype(np.uint8)
    read, coded = _webp(stack.reshape(-1, size[1], 3), _BASIS_QUALITY)
    stack = read.reshape(len(stack), -1).astype(np.float64)
    mean, axes = stack[0], (stack[1:] - 128) / 127 * scale
    step = _STEP * np.sqrt(flat.shape[1])
    coordinates = np.linalg.lstsq(axes.T, (flat - mean).T, rcond=None)[0].T if len(axes) else np.zeros((len(flat), 0))
    whole = np.round(coordinates / step).astype(int)
    header: dict[str, object] = {
        "label": group.label,
        "boxes": group.boxes.tolist(),
        "light": np.round(group.light * 128).astype(int).tolist(),
        "types": group.types.tolist(),
        "coordinates": whole.tolist(),
        "scales": [round(s, 6) for s in scale[:, 0].tolist()],
    }
    return (mean + whole * step @ axes).reshape(len(flat), *size, 3).astype(np.float32), coded, header


def _webp(image: np.ndarray, quality: int) -> tuple[np.ndarray, bytes]:
    """An image as its reader sees it, and the file."""
    out = io.BytesIO()
    Image.fromarray(image).save(out, "WEBP", quality=quality, method=4)
    with Image.open(out, formats=["WEBP"]) as read:
        return np.asarray(read.convert("RGB")), out.getvalue()
