"""Worker of `exemplars`: read, parse, complete and measure an exemplar, and resample it to the block's density."""

from __future__ import annotations

import time

import numpy as np
from icechunk import ForkSession

from facade_core.atlas.journal import Record, read_records
from facade_core.atlas.store import open_root
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.atlas_spec import ArraySpec
from facade_core.core.errors import StoreError
from facade_core.core.labels import FLAGS, FacadeClass
from facade_core.core.resizing import resize_with_labels
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.occlusion_overlay import draw_crop_preview
from facade_core.facade.exemplar import Exemplar, prepare_exemplar
from facade_core.imagery.detect.detection import detect_faces_plates_text, detectors_available
from facade_core.imagery.privacy import apply_privacy
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.plan.exemplar_style import style_descriptor
from tasks.engine.context import current_worker_name
from tasks.engine.run import Run
from tasks.engine.seeds import EXEMPLAR_SEED, unit_seed
from tasks.engine.unit import UnitGroup
from tasks.stages.exemplars.record import ExemplarRecord
from tasks.stages.shared.images import MAX_EXEMPLAR_SIDE, read_exemplar_picture, read_labels

IMAGE = ArraySpec(
    "image", ("row", "column", "band"), "uint8", "exemplar at the block's density or coarser, without what hid it"
)
PREVIEW = ArraySpec(
    "preview", ("preview_row", "preview_column", "band"), "uint8", "picture as given: cut off dark, made anew tinted"
)
LABELS = ArraySpec("labels", ("row", "column"), "uint8", "class id as in facade_core.core.labels, 255 unknown", FLAGS)


def process_exemplar(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Prepare one exemplar and write its image and labels through the fork; returns the fork and the record."""
    start = time.time()
    (unit,) = units
    (path,) = unit.arguments
    picture = read_exemplar_picture(path)
    hidden = picture.hidden | no_data_mask(picture.rgb)
    private = detect_faces_plates_text(picture.rgb).private_mask(hidden.shape)
    seconds = {"read": time.time() - start}
    seed = unit_seed(run, unit.name, EXEMPLAR_SEED)
    prepared = prepare_exemplar(
        picture.rgb,
        hidden,
        floor_height=run.storey,
        private=private,
        labels=read_labels(path, hidden.shape),
        models=run.models,
        seed=seed,
    )
    seconds |= prepared.seconds
    begun = time.time()
    factor = prepared.metres_per_pixel * run.texture.texels_per_metre
    height, width = (max(8, round(side * factor)) for side in prepared.labels.shape)
    shrink = min(1.0, MAX_EXEMPLAR_SIDE / max(height, width))
    size = (round(width * shrink), round(height * shrink))
    texture, labels = resize_with_labels(prepared.image, prepared.labels, size[::-1])
    metres_per_texel = 1 / (run.texture.texels_per_metre * shrink)

    group = open_root(fork)
    IMAGE.write(group, f"exemplars/{unit.index}", texture)
    LABELS.write(group, f"exemplars/{unit.index}", labels)
    PREVIEW.write(group, f"exemplars/{unit.index}", _draw_preview(run, picture.rgb, private, prepared))
    seconds["write"] = time.time() - begun
    record: ExemplarRecord = {
        "unit": unit.name,
        "key": unit.key,
        "status": "done",
        "width_m": size[0] * metres_per_texel,
        "height_m": size[1] * metres_per_texel,
        "metres_per_texel": metres_per_texel,
        "floors": prepared.floors,
        "columns": prepared.columns,
        "hidden": round(float(prepared.occluded.mean()), 4),
        "shaded": round(prepared.shaded_share, 4),
        "cut_found": prepared.has_facade,
        "shop_width": round(float((labels == FacadeClass.SHOP).any(axis=0).mean()), 4),
        "look": style_descriptor(texture, labels, metres_per_texel),
        "metres_per_pixel": prepared.metres_per_pixel,
        "looked": detectors_available(),
        "worker": current_worker_name(),
        "started": start,
        "seconds": {stage: round(s, 4) for stage, s in seconds.items()},
    }
    return fork, {unit.index: record}


def _draw_preview(run: Run, given: UInt8Array, private: BoolArray, prepared: Exemplar) -> UInt8Array:
    """Draw a picture as given, with its cropped and completed parts marked, under the block's privacy setting."""
    x0, y0, x1, y1 = prepared.box
    shown = apply_privacy(given, private, run.privacy, 1 / prepared.metres_per_pixel).copy()
    shown[y0:y1, x0:x1] = apply_privacy(
        prepared.evidence, prepared.occluded, run.privacy, 1 / prepared.metres_per_pixel
    )
    return draw_crop_preview(shown, prepared.occluded, prepared.box)


def read_exemplar(group: StoreGroup, index: int) -> tuple[UInt8Array, UInt8Array, float]:
    """Read a prepared exemplar.

    Returns
    -------
    image : (h, w, 3) uint8.
    labels : (h, w) uint8 class ids.
    metres_per_texel : scale: the block's density, or coarser for an exemplar larger than MAX_EXEMPLAR_SIDE.

    Raises
    ------
    StoreError : it has no record.
    """
    (record,) = read_records(group, "exemplars", np.array([index]), ExemplarRecord)
    if record is None:
        raise StoreError(f"exemplar {index} has no record; the next run makes it again")
    return group[f"exemplars/{index}/image"][:], group[f"exemplars/{index}/labels"][:], record["metres_per_texel"]
