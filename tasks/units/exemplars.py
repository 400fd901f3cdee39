"""One exemplar: read, parsed, completed, measured and brought to the block's density."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from facade_core.atlas.journal import Record
from facade_core.atlas.spec import Array
from facade_core.atlas.store import open_root
from facade_core.atlas.zarr_types import StoreGroup
from facade_core.facade import prepare_exemplar
from facade_core.labels import FLAGS
from tasks.run import Run
from tasks.units.context import unit_seed, worker_name
from tasks.units.images import LONGEST_EXEMPLAR, read_exemplar_picture
from tasks.units.unit import Piece

IMAGE = Array("image", ("row", "column", "band"), "uint8", "exemplar at the block's density, without what hid it")
LABELS = Array("labels", ("row", "column"), "uint8", "class id as in facade_core.labels, 255 unknown", FLAGS)


def exemplar_unit(run: Run, fork: Any, units: Piece) -> tuple[Any, dict[int, Record]]:
    """Prepare one exemplar and write its image and labels through the fork; returns the fork and the journal record."""
    start = time.time()
    import cv2

    (unit,) = units
    (path,) = unit.arguments
    picture = read_exemplar_picture(path)
    hidden = picture.hidden
    seconds = {"read": time.time() - start}
    prepared = prepare_exemplar(picture.rgb, hidden, storey=run.storey, seed=unit_seed(run, unit.name, "exemplar"))
    seconds |= prepared.facade.seconds
    begun = time.time()
    factor = prepared.metres_per_pixel * run.texture.texels_per_metre
    height, width = (max(8, round(side * factor)) for side in prepared.facade.labels.shape)
    shrink = min(1.0, LONGEST_EXEMPLAR / max(height, width))
    size = (round(width * shrink), round(height * shrink))
    texture = cv2.resize(prepared.facade.image, size, interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC)
    labels = cv2.resize(prepared.facade.labels, size, interpolation=cv2.INTER_NEAREST)

    group = open_root(fork)
    IMAGE.write(group, f"exemplars/{unit.index}", texture)
    LABELS.write(group, f"exemplars/{unit.index}", labels)
    seconds["write"] = time.time() - begun
    record: Record = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "width_m": size[0] / run.texture.texels_per_metre,
        "height_m": size[1] / run.texture.texels_per_metre,
        "floors": prepared.floors,
        "columns": prepared.columns,
        "hidden": round(float(hidden.mean()), 4),
        "metres_per_pixel": prepared.metres_per_pixel,
        "worker": worker_name(),
        "started": start,
        "seconds": {stage: round(s, 4) for stage, s in seconds.items()},
    }
    return fork, {unit.index: record}


def read_exemplar(group: StoreGroup, index: int) -> tuple[np.ndarray, np.ndarray]:
    """A prepared exemplar at the block's density: image (h, w, 3) uint8 and labels (h, w) uint8."""
    return group[f"exemplars/{index}/image"][:], group[f"exemplars/{index}/labels"][:]
