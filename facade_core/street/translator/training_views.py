"""Training data of the translator: street renderings and crops of real panoramas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facade_core.core.arrays import AnyArray, BoolArray, Float64Array, IntArray, UInt8Array
from facade_core.geometry.charts import Mesh
from facade_core.geometry.raycast import MISS, RayCaster
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.propagation.propagate import propagate_panorama
from facade_core.street.propagation.render import daylight_grey, render_panorama
from facade_core.street.propagation.texel_buffer import TexelBuffer

# Widths of the panoramas: windows in one are as large as those of a nearer facade in the other.
PANORAMA_WIDTHS = (512, 1024)
# Rows that show the street, as shares of the height; others show the zenith and the camera's mount. The lowest row
# shows ground at 1 m from a camera at 2.5 m.
USED_ROWS = (0.1, 0.88)
# Range of untextured renderings.
_GREY_RANGE = (110, 240)


@dataclass(frozen=True, slots=True)
class TrainingRendering:
    """Untextured rendering of a viewpoint.

    Attributes
    ----------
    grey : (h, w) uint8.
    textured : (h, w) bool, texels textured by earlier viewpoints.
    """

    grey: UInt8Array
    textured: BoolArray


@dataclass(frozen=True, slots=True)
class TrainingCrop:
    """Crop of a panorama, with its textured pixels and its place.

    Attributes
    ----------
    image : (h, w, 3) uint8.
    textured : (h, w) bool.
    place : first row and height of the panorama.
    """

    image: UInt8Array
    textured: BoolArray
    place: tuple[int, int]


@dataclass(frozen=True, slots=True)
class TrainingPair:
    """Viewpoint of a street without and with texture.

    Attributes
    ----------
    rendering : untextured rendering.
    image : (h, w, 3) uint8 of the same size.
    valid : (h, w) bool, pixels to learn from.
    """

    rendering: TrainingRendering
    image: UInt8Array
    valid: BoolArray


def render_sequence(
    scene: Scene,
    viewpoints: Sequence[Viewpoint],
    *,
    furniture: Mesh | None = None,
    relief: dict[int, UInt8Array] | None = None,
) -> list[TrainingRendering]:
    """Render viewpoints of one street in order, each with the texture of its predecessors.

    Parameters
    ----------
    scene : the block's geometry.
    viewpoints : viewpoints of the street.
    furniture : occluders without texture.
    relief : grey (h, w) uint8 of charts that are not plain, in the size of their rasters.
    """
    width = max(PANORAMA_WIDTHS)
    size = (width // 2, width)
    charts = np.unique(np.concatenate([scene.visible_charts(viewpoint, width) for viewpoint in viewpoints]))
    plain, textured = _make_buffer(scene, charts, relief or {}), _make_buffer(scene, charts, {})
    caster = RayCaster(furniture) if furniture else None
    renderings = []
    for viewpoint in viewpoints:
        panorama = render_panorama(scene, plain, viewpoint, size)
        known = render_panorama(scene, textured, viewpoint, size).textured
        grey = panorama.rgb[..., 0].copy()
        if caster and furniture:
            rays = scene.cast_panorama(viewpoint, width)[0]
            distance, body = caster.cast(viewpoint.position, rays)
            in_front = (body != MISS) & (distance < panorama.depth)
            light = 255 * daylight_grey(_triangle_normals(furniture))
            grey[in_front] = light[body[in_front]]
            known[in_front] = False
        propagate_panorama(scene, textured, viewpoint, panorama.rgb, charts_seen=panorama.chart)
        renderings.append(TrainingRendering(grey, known))
    return renderings


def _make_buffer(scene: Scene, charts: IntArray, seeds: dict[int, UInt8Array]) -> TexelBuffer:
    """Allocate a buffer in which some charts have texture from the start."""
    rasters, write = TexelBuffer.plan_layout(scene.placement, charts, charts)
    colour, evidence = np.zeros((rasters.total, 3), np.uint8), np.zeros(rasters.total, np.uint8)
    for chart in set(seeds) & set(charts.tolist()):
        texels = rasters.texel_slice(scene.placement, chart)
        colour[texels], evidence[texels] = seeds[chart].reshape(-1, 1), 1
    return TexelBuffer.allocate(
        scene.placement, rasters, write, colour, evidence, visibility_range=scene.visibility_range
    )


def _triangle_normals(mesh: Mesh) -> Float64Array:
    a, b, c = (mesh.vertices[mesh.triangles[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    unit_normals: Float64Array = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return unit_normals


def random_rendering_crop(
    renderings: Sequence[TrainingRendering], size: tuple[int, int], rng: np.random.Generator
) -> TrainingCrop:
    """Take a random crop of a random rendering at one of PANORAMA_WIDTHS, possibly mirrored.

    `textured` is random too: that of the engine, or nothing.

    Parameters
    ----------
    renderings : renderings to choose from.
    size : height and width of the crop, pixels.
    rng : random generator.
    """
    import cv2

    chosen = renderings[int(rng.integers(len(renderings)))]
    width = PANORAMA_WIDTHS[int(rng.integers(len(PANORAMA_WIDTHS)))]
    shape = (width, width // 2)
    grey = cv2.resize(chosen.grey, shape, interpolation=cv2.INTER_AREA)
    known = cv2.resize(chosen.textured.astype(np.uint8), shape, interpolation=cv2.INTER_NEAREST) > 0
    if rng.random() < 0.25:
        known = np.zeros_like(known)
    return _cut_crop(np.repeat(grey[..., None], 3, 2), known, size, rng)


def random_panorama_crop(
    panoramas: Sequence[UInt8Array], size: tuple[int, int], rng: np.random.Generator
) -> TrainingCrop:
    """Take a random crop of a random panorama: rotated, mirrored, in varied light.

    Parameters
    ----------
    panoramas : (h, w, 3) uint8 each.
    size : height and width of the crop, pixels.
    rng : random generator.
    """
    import cv2

    chosen = panoramas[int(rng.integers(len(panoramas)))]
    width = PANORAMA_WIDTHS[int(rng.integers(len(PANORAMA_WIDTHS)))]
    image = cv2.resize(chosen, (width, width // 2), interpolation=cv2.INTER_AREA)
    crop = _cut_crop(image, np.zeros(image.shape[:2], bool), size, rng)
    light = rng.uniform(0.85, 1.15) * rng.uniform(0.95, 1.05, 3)
    return TrainingCrop(np.clip(crop.image * light, 0, 255).astype(np.uint8), crop.textured, crop.place)


def random_pair_crop(
    pairs: Sequence[TrainingPair], size: tuple[int, int], rng: np.random.Generator
) -> tuple[TrainingCrop, UInt8Array, BoolArray]:
    """Take a random crop of a random pair at one of PANORAMA_WIDTHS, possibly mirrored.

    Parameters
    ----------
    pairs : pairs to choose from.
    size : height and width of the crop, pixels.
    rng : random generator.

    Returns
    -------
    The untextured crop, its image (h, w, 3) uint8, and its valid pixels (h, w) bool.
    """
    import cv2

    chosen = pairs[int(rng.integers(len(pairs)))]
    width = PANORAMA_WIDTHS[int(rng.integers(len(PANORAMA_WIDTHS)))]
    shape = (width, width // 2)
    grey, image = (
        cv2.resize(part, shape, interpolation=cv2.INTER_AREA) for part in (chosen.rendering.grey, chosen.image)
    )
    known, valid = (
        cv2.resize(part.astype(np.uint8), shape, interpolation=cv2.INTER_NEAREST) > 0
        for part in (chosen.rendering.textured, chosen.valid)
    )
    if rng.random() < 0.25:
        known = np.zeros_like(known)
    crop = _cut_crop(
        np.dstack([np.repeat(grey[..., None], 3, 2), image, np.where(valid, 255, 0)]), known & valid, size, rng
    )
    grey, image, valid = crop.image[..., :3], crop.image[..., 3:6], crop.image[..., 6] > 0
    return TrainingCrop(grey.astype(np.uint8), crop.textured, crop.place), image.astype(np.uint8), valid


def imitate_rendering(photo: UInt8Array) -> UInt8Array:
    """Convert a real crop to an imitation of an untextured rendering.

    Keeps shading without detail; the sky is black.

    Parameters
    ----------
    photo : (h, w, 3) uint8.

    Returns
    -------
    (h, w) uint8.
    """
    import cv2

    grey = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)
    smooth = cv2.bilateralFilter(cv2.medianBlur(grey, 5), 7, 40, 5)
    bright = (grey > 150) | ((photo[..., 2] > photo[..., 0] + 25) & (grey > 90))
    _, parts = cv2.connectedComponents(bright.astype(np.uint8))
    sky = bright & np.isin(parts, np.unique(parts[0][bright[0]]))
    rest = smooth[~sky] if (~sky).any() else smooth
    low, high = np.percentile(rest, [2, 98])
    out: UInt8Array = np.clip(
        _GREY_RANGE[0] + (smooth - low) * ((_GREY_RANGE[1] - _GREY_RANGE[0]) / max(high - low, 1)), *_GREY_RANGE
    ).astype(np.uint8)
    out[sky] = 0
    return out


def _cut_crop(image: AnyArray, known: BoolArray, size: tuple[int, int], rng: np.random.Generator) -> TrainingCrop:
    height, width = image.shape[:2]
    first, last = (round(share * height) for share in USED_ROWS)
    top = int(rng.integers(first, max(last - size[0], first) + 1))
    columns = (int(rng.integers(width)) + np.arange(size[1])) % width
    if rng.random() < 0.5:
        columns = columns[::-1]
    rows = slice(top, top + size[0])
    return TrainingCrop(image[rows][:, columns], known[rows][:, columns], (top, height))
