"""Panoramas as cameras, and the surfaces that they show, written to the base layer."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from facade_core.atlas.rasters import TexelLayout, chart_digests, describe_completeness, write_rasters
from facade_core.core.arrays import AnyArray, BoolArray, UInt8Array
from facade_core.core.provenance import Provenance
from facade_core.core.types import Pose
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.scene import Scene
from facade_core.imagery.cameras.camera_view import FusedCameraView, PanoramaCamera
from facade_core.imagery.cameras.exposure import typical_ground_colour
from facade_core.imagery.detect.detection import detect_on_panorama
from facade_core.imagery.panorama_camera import camera_position
from facade_core.plan.plan import Plan
from tasks.engine.atlas import Atlas
from tasks.engine.outcome import collect_input_errors, rejection_record_fields
from tasks.stages.shared.images import MAX_PIXELS, max_picture_pixels, read_panorama
from tasks.stages.shared.surface_panorama import SurfacePanorama

# Bytes of the kept masks of occluders: of eight of the widest panoramas, or of hundreds of pictures of a lens.
MAX_MASK_BYTES = 8 * 2 * MAX_PIXELS // 8

# What stands before surfaces on a panorama (H, W, 3) uint8 of a pose: (H, W) bool.
Hides = Callable[[UInt8Array, Pose], BoolArray]


def open_camera(one: SurfacePanorama, hides: Hides, refused: list[Exception]) -> PanoramaCamera | None:
    """Open a panorama as a camera; None if that fails, with the error appended to `refused`."""
    with collect_input_errors(refused):
        image = read_panorama(one.path, max_picture_pixels(one.pose))
        occluded, private = _occluder_masks(one, image, hides)
        return PanoramaCamera(
            image, one.pose, occluded, np.array(one.factor), typical_ground_colour(one.squares), private
        )
    return None


def collect_chart_views(
    taken: Mapping[int, Sequence[SurfacePanorama]],
    opened: Callable[[SurfacePanorama], PanoramaCamera | None],
    show: Callable[[int, Sequence[PanoramaCamera]], FusedCameraView | None],
) -> tuple[dict[int, FusedCameraView], dict[int, list[SurfacePanorama]]]:
    """Collect the views of charts, each from its own panoramas; returns also the panoramas that opened.

    At most the panoramas of one chart are open at a time: charts with the same panoramas follow each other.
    """
    held: dict[SurfacePanorama, PanoramaCamera | None] = {}
    found, used = {}, {}
    for chart in sorted(taken, key=lambda chart: [str(one.path) for one in taken[chart]]):
        # failed panoramas stay cached: each is reported once
        held = {one: camera for one, camera in held.items() if camera is None or one in taken[chart]}
        for one in taken[chart]:
            if one not in held:
                held[one] = opened(one)
        used[chart] = [one for one in taken[chart] if held[one] is not None]
        shown = show(chart, list(filter(None, map(held.get, used[chart])))) if used[chart] else None
        if shown is not None:
            found[chart] = shown
    return found, used


class PanoramaSurfaces(NamedTuple):
    """Charts as panoramas show them.

    Attributes
    ----------
    found : view by chart.
    used : panoramas by chart.
    refused : errors of panoramas that cannot be used.
    seconds : seconds by step.
    """

    found: Mapping[int, FusedCameraView]
    used: Mapping[int, Sequence[SurfacePanorama]]
    refused: Sequence[Exception]
    seconds: Mapping[str, float]


def write_panorama_surfaces(atlas: Atlas, _unit: object, result: PanoramaSurfaces) -> dict[str, object]:
    """Write charts as panoramas show them to the base layer; returns the fields of their record."""
    digests, told = _write_fused_views(atlas.group, atlas.plan, result.found, result.used)
    rejected = rejection_record_fields(result.refused, "without it")
    completeness = describe_completeness(one.is_visible for one in result.found.values())
    return {"digests": digests, "cameras": told, "seconds": result.seconds, **completeness, **rejected}


def _write_fused_views(
    group: StoreGroup, plan: Plan, found: Mapping[int, FusedCameraView], used: Mapping[int, Sequence[SurfacePanorama]]
) -> tuple[dict[str, str], list[tuple[str, float, float]]]:
    """Write the views of charts to the base layer.

    Returns
    -------
    digests : digests of the charts.
    cameras : of each panorama that shows some: name, share of all texels, mean distance in metres.
    """
    scene, placement = plan.scene, plan.scene.placement
    if not found:
        return {}, []
    showing = {
        used[chart][camera] for chart, one in found.items() for camera in np.unique(one.camera).tolist() if camera >= 0
    }
    numbers = {one: number for number, one in enumerate(sorted(showing, key=lambda one: one.path), 1)}
    rasters = TexelLayout.of_charts(placement, sorted(found))
    seed, evidence = np.empty((rasters.total, 3), np.uint8), np.empty(rasters.total, np.uint8)
    camera, confidence = np.empty(rasters.total, np.uint16), np.empty(rasters.total, np.uint8)
    for chart, one in found.items():
        texels = rasters.texel_slice(placement, chart)
        seed[texels] = one.rgb.reshape(-1, 3)
        evidence[texels] = np.where(one.is_visible, Provenance.PHOTO, Provenance.UNSEEN).reshape(-1)
        # the first is none
        of_chart = np.array([0, *(numbers.get(panorama, 0) for panorama in used[chart])], np.uint16)
        camera[texels] = of_chart[one.camera.astype(np.int64) + 1].reshape(-1)
        confidence[texels] = np.round(255 * one.confidence.clip(0, 1)).reshape(-1)
    arrays: dict[str, AnyArray] = {
        "atlas/seed": seed,
        "atlas/seed_evidence": evidence,
        "facade_maps/camera": camera,
        "facade_maps/confidence": confidence,
    }
    for name, flat in arrays.items():
        write_rasters(group[name], scene.spec, placement, rasters, flat)
    told = []
    for one, number in numbers.items():
        own = {chart: shown.camera == used[chart].index(one) for chart, shown in found.items() if one in used[chart]}
        told.append((one.path.name, round(float((camera == number).mean()), 4), _mean_distance(scene, own, one)))
    return chart_digests(seed, evidence, placement, rasters, plan.ids), told


def _mean_distance(scene: Scene, own: Mapping[int, AnyArray], one: SurfacePanorama) -> float:
    """Return the mean distance of a camera from texels (h, w) of charts, metres."""
    away = []
    for chart, texels in own.items():
        rows, columns = np.nonzero(texels)
        step = 1 / scene.placement.texels_per_metre[chart]
        points = scene.charts.points(chart, step * (columns + 0.5), step * (rows + 0.5))
        away.append(np.linalg.norm(points - camera_position(one.pose), axis=1))
    return round(float(np.concatenate(away).mean()), 2)


# What hides surfaces on the panoramas looked at last, and faces and plates, in bits, by what looked and their file and pose:
# units side by side share them.
_MASKS: OrderedDict[tuple[str, Path, int, int, Pose], tuple[UInt8Array, UInt8Array | None]] = OrderedDict()


def _occluder_masks(one: SurfacePanorama, image: UInt8Array, hides: Hides) -> tuple[BoolArray, BoolArray | None]:
    """Return the occluders, faces and plates on a panorama, (H, W) bool, and faces and plates alone if there are any."""
    state = one.path.stat()
    of = (hides.__name__, one.path, state.st_size, state.st_mtime_ns, one.pose)
    bits = _MASKS.get(of)
    if bits is None:
        seen = detect_on_panorama(image, one.pose)
        private = seen.private_mask(image.shape[:2]) if seen.has_private_boxes() else None
        hidden = hides(image, one.pose)
        whole, own = (hidden, None) if private is None else (hidden | private, np.packbits(private))
        bits = np.packbits(whole), own
        _MASKS[of] = bits
        while sum(whole.nbytes + (0 if own is None else own.nbytes) for whole, own in _MASKS.values()) > MAX_MASK_BYTES:
            _MASKS.popitem(last=False)
    _MASKS.move_to_end(of)
    return _unpack_bits(bits[0], image.shape[:2]), None if bits[1] is None else _unpack_bits(bits[1], image.shape[:2])


def _unpack_bits(bits: UInt8Array, shape: tuple[int, int]) -> BoolArray:
    return np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape).astype(bool)
