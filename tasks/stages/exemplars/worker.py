"""Worker of `exemplars`: read, parse, complete and measure an exemplar, and resample it to the block's density."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from icechunk import ForkSession

from catalogs.examples.painted_pictures import shipped_style
from facade_core.atlas.journal import Record, read_records
from facade_core.atlas.store import open_root
from facade_core.atlas.stored_files import digest_stored_file, exemplar_folder
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.atlas_spec import ArraySpec
from facade_core.core.errors import StoreError
from facade_core.core.labels import FLAGS, FacadeClass
from facade_core.core.resizing import resize_with_labels
from facade_core.core.types import Privacy, TrainedModelFiles
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.occlusion_overlay import draw_crop_preview
from facade_core.facade.exemplar import Exemplar, measure_narrowest_shop, prepare_exemplar
from facade_core.imagery.detect.detection import detect_faces_plates_text, detectors_available
from facade_core.imagery.privacy import apply_privacy
from facade_core.imagery.rectify.no_data import no_data_mask
from facade_core.plan.exemplar_style import style_descriptor
from tasks.engine.atlas import Atlas
from tasks.engine.inputs import MODELS_CHANGED, PICTURE_CHANGED, SETTINGS_CHANGED, input_field
from tasks.engine.processing import process_unit
from tasks.engine.run import Run
from tasks.engine.unit import Unit, UnitGroup
from tasks.stages.exemplars.record import ExemplarFacts, ExemplarRecord
from tasks.stages.exemplars.shared import PreparedExemplar, read_shared_exemplar, write_shared_exemplar
from tasks.stages.shared.images import MAX_EXEMPLAR_SIDE, read_exemplar_picture, read_labels

IMAGE = ArraySpec(
    "image", ("row", "column", "band"), "uint8", "exemplar at the block's density or coarser, without what hid it"
)
PREVIEW = ArraySpec(
    "preview", ("preview_row", "preview_column", "band"), "uint8", "picture as given: cut off dark, made anew tinted"
)
LABELS = ArraySpec("labels", ("row", "column"), "uint8", "class id as in facade_core.core.labels, 255 unknown", FLAGS)


@dataclass(frozen=True)
class ExemplarInputs:
    """Inputs of an exemplar.

    Attributes
    ----------
    picture : its picture.
    labels : the label map beside it.
    models : trained models; an exemplar is parsed and not completed.
    storey : height of a storey, metres.
    texels_per_metre : density of the block.
    privacy : treatment of people and cars.
    seed : seed of its random choices.
    """

    picture: Path = input_field(PICTURE_CHANGED)
    labels: Path | None = input_field(PICTURE_CHANGED)
    models: TrainedModelFiles = input_field(MODELS_CHANGED)
    storey: float = input_field(SETTINGS_CHANGED)
    texels_per_metre: float = input_field(SETTINGS_CHANGED)
    privacy: Privacy = input_field(SETTINGS_CHANGED)
    seed: int = input_field(SETTINGS_CHANGED)


def process_exemplar(run: Run, fork: ForkSession, units: UnitGroup) -> tuple[ForkSession, dict[int, Record]]:
    """Prepare one exemplar and write it through the fork; in a city, what another block has prepared is read."""
    (unit,) = units
    known = read_shared_exemplar(run, unit)
    prepared = known or prepare_picture(unit.inputs)
    if known is None:
        write_shared_exemplar(run, unit, prepared)
    atlas = Atlas(run, open_root(fork))
    return fork, {unit.index: process_unit(lambda inputs: prepared, write_exemplar, atlas, unit, is_whole=True)}


def write_exemplar(atlas: Atlas, unit: Unit[ExemplarInputs], prepared: PreparedExemplar) -> dict[str, object]:
    """Write the image, labels and preview of an exemplar; returns the fields of its record."""
    folder, files = exemplar_folder(unit.inputs.picture.name), {}
    arrays = (prepared.image, prepared.labels, prepared.preview)
    for spec, array in zip((IMAGE, LABELS, PREVIEW), arrays, strict=True):
        spec.write(atlas.group, folder, array)
        files[f"{folder}/{spec.path}"] = digest_stored_file(np.ascontiguousarray(array).data)
    return {"folder": folder, "seconds": prepared.seconds, "files": files, **prepared.facts}


def prepare_picture(inputs: ExemplarInputs) -> PreparedExemplar:
    """Read, parse, complete and measure an exemplar, and resample it to the block's density."""
    start = time.time()
    picture = read_exemplar_picture(inputs.picture)
    hidden = picture.hidden | no_data_mask(picture.rgb)
    private = detect_faces_plates_text(picture.rgb).private_mask(hidden.shape)
    seconds = {"read": time.time() - start}
    prepared = prepare_exemplar(
        picture.rgb,
        hidden,
        floor_height=inputs.storey,
        private=private,
        labels=read_labels(inputs.picture, hidden.shape),
        models=inputs.models,
        seed=inputs.seed,
    )
    factor = prepared.metres_per_pixel * inputs.texels_per_metre
    height, width = (max(8, round(side * factor)) for side in prepared.labels.shape)
    shrink = min(1.0, MAX_EXEMPLAR_SIDE / max(height, width))
    size = (round(width * shrink), round(height * shrink))
    texture, labels = resize_with_labels(prepared.image, prepared.labels, size[::-1])
    metres_per_texel = 1 / (inputs.texels_per_metre * shrink)
    facts: ExemplarFacts = {
        "width_m": size[0] * metres_per_texel,
        "height_m": size[1] * metres_per_texel,
        "metres_per_texel": metres_per_texel,
        "floors": prepared.floors,
        "columns": prepared.columns,
        "hidden": round(float(prepared.occluded.mean()), 4),
        "shaded": round(prepared.shaded_share, 4),
        "cut_found": prepared.has_facade,
        "shop_width": round(float((labels == FacadeClass.SHOP).any(axis=0).mean()), 4),
        "front_m": round(measure_narrowest_shop(labels, metres_per_texel), 2),
        "look": style_descriptor(texture, labels, metres_per_texel),
        "quality": round(prepared.quality.score, 3),
        "quality_parts": asdict(prepared.quality),
        "metres_per_pixel": prepared.metres_per_pixel,
        "looked": detectors_available(),
    }
    if (style := shipped_style(inputs.picture)) is not None:
        facts["style"] = style
    preview = _draw_preview(inputs.privacy, picture.rgb, private, prepared)
    return PreparedExemplar(texture, labels, preview, facts, seconds | prepared.seconds)


def _draw_preview(privacy: Privacy, given: UInt8Array, private: BoolArray, prepared: Exemplar) -> UInt8Array:
    """Draw a picture as given, with its cropped and completed parts marked, under the block's privacy setting."""
    x0, y0, x1, y1 = prepared.box
    shown = apply_privacy(given, private, privacy, 1 / prepared.metres_per_pixel).copy()
    shown[y0:y1, x0:x1] = apply_privacy(prepared.evidence, prepared.occluded, privacy, 1 / prepared.metres_per_pixel)
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
    folder = record["folder"]
    return group[f"{folder}/image"][:], group[f"{folder}/labels"][:], record["metres_per_texel"]
