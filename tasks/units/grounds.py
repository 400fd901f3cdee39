"""What panoramas show of a piece of ground, into the atlas."""

from __future__ import annotations

import time
from collections import OrderedDict
from pathlib import Path
from typing import Any, cast

import numpy as np

from facade_core.atlas.journal import Record
from facade_core.atlas.provenance import PHOTO, UNSEEN
from facade_core.atlas.rasters import Rasters, chart_digests, write_rasters
from facade_core.atlas.store import open_root
from facade_core.cameras import Camera, in_the_way, photographed, usual_of
from facade_core.detect import look_on_panorama
from facade_core.rectify.camera import position
from facade_core.types import Pose
from tasks.outcome import refusal, refusing
from tasks.run import Run
from tasks.units.context import plan_of_run, worker_name
from tasks.units.imagery import Taken
from tasks.units.images import read_panorama
from tasks.units.unit import Piece

# Panoramas of which it is kept what hides their ground.
KEPT = 8


def ground_unit(run: Run, fork: Any, units: Piece) -> tuple[Any, dict[int, Record]]:
    """Write what panoramas show of one piece of ground through the fork; returns the fork and the journal record."""
    start = time.time()
    (unit,) = units
    chart, taken = unit.arguments
    plan = plan_of_run(run)
    scene, group = plan.scene, open_root(fork)
    refused: list[Exception] = []
    cameras, used = [], []
    for one in taken:
        with refusing(refused):
            cameras.append(_camera(one))
            used.append(one)
    read = time.time()
    found = photographed(scene, chart, cameras) if cameras else None
    record: Record = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "digests": {},
        "cameras": [],
        "worker": worker_name(),
        "started": start,
        "seconds": {"read": round(read - start, 4), "ground": round(time.time() - read, 4)},
    }
    if found is not None:
        seed = found.rgb.reshape(-1, 3)
        evidence = np.where(found.shown, PHOTO, UNSEEN).astype(np.uint8).reshape(-1)
        shown = [number for number in range(len(used)) if (found.camera == number).any()]
        numbers = np.zeros(len(used) + 1, np.uint16)  # the first is none
        numbers[np.array(shown) + 1] = np.arange(len(shown)) + 1
        arrays = {
            "atlas/seed": seed,
            "atlas/seed_evidence": evidence,
            "facade_maps/camera": numbers[found.camera.astype(np.int64) + 1].reshape(-1),
            "facade_maps/confidence": np.round(255 * found.confidence.clip(0, 1)).astype(np.uint8).reshape(-1),
        }
        rasters = Rasters.of(scene.placement, [chart])
        for name, flat in arrays.items():
            write_rasters(group[name], scene.spec, scene.placement, rasters, flat)
        record["digests"] = chart_digests(seed, evidence, scene.placement, rasters, plan.ids)
        record["cameras"] = [
            [
                used[number].path.name,
                round(float((found.camera == number).mean()), 4),
                _far(scene, chart, found.camera == number, used[number]),
            ]
            for number in shown
        ]
    record |= cast(Record, refusal(refused, "without it"))
    return fork, {unit.index: record}


def _far(scene: Any, chart: int, own: np.ndarray, one: Taken) -> float:
    """How far the camera was on the mean from some texels (h, w) bool of a chart, metres."""
    rows, columns = np.nonzero(own)
    step = 1 / scene.placement.texels_per_metre[chart]
    points = scene.charts.points(chart, step * (columns + 0.5), step * (rows + 0.5))
    return round(float(np.linalg.norm(points - position(one.pose), axis=1).mean()), 2)


def _camera(one: Taken) -> Camera:
    image = read_panorama(one.path)
    return Camera(image, one.pose, _hidden(one, image), np.array(one.factor), usual_of(one.squares))


# What hides the ground on the panoramas looked at last, in bits, by their file and pose: pieces side by side share them.
_LOOKED_AT: OrderedDict[tuple[Path, int, int, Pose], np.ndarray] = OrderedDict()


def _hidden(one: Taken, image: np.ndarray) -> np.ndarray:
    """What stands on the ground of a panorama, and the faces and plates that there are on it: (H, W) bool."""
    state = one.path.stat()
    of = (one.path, state.st_size, state.st_mtime_ns, one.pose)
    bits = _LOOKED_AT.get(of)
    if bits is None:
        seen = look_on_panorama(image, one.pose.view)
        hidden = in_the_way(image, one.pose)
        bits = np.packbits(hidden | seen.hidden(image.shape[:2]) if seen.any() else hidden)
        _LOOKED_AT[of] = bits
        if len(_LOOKED_AT) > KEPT:
            _LOOKED_AT.popitem(last=False)
    return np.unpackbits(bits, count=image.shape[0] * image.shape[1]).reshape(image.shape[:2]).astype(bool)
