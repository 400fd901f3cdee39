"""A facade's stages as pictures, drawn from the store when somebody looks."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np

from facade_core.errors import InputError
from facade_core.export import draw_facade, overlay_hidden
from facade_core.labels import CLASSES, COLOURS, colourise
from facade_core.types import Lattice
from facade_core.variation import Hierarchy
from tasks.viewing.reading import View

# An element of which more than this share was hidden comes from the completed layout.
_COMPLETED = 0.3
# Pictures are drawn at least this high, so that lines over small facades stay thin.
_LEAST_HEIGHT = 480


def stages(view: View, index: int) -> list[tuple[str, str]]:
    """The stages (key, title) that facade number `index` has pictures of, in their order; none before it is done."""
    record = view.records[index]
    if record is None or "lattice" not in record:
        return []
    of_photo = (record.get("provenance") or [0])[-1] > 0 or record.get("occluded")
    found = [("source", "Exemplar it is made from")] if _exemplar(view, record["source"]) is not None else []
    if of_photo:
        found.append(("rectified", "Photo, rectified"))
        if record.get("occluded"):
            found.append(("hidden", "What hides the wall"))
    found += [("parse", "Parse"), ("lattice", "Lattice"), ("layout", "Layout" + (", completed" if of_photo else ""))]
    found.append(("texture", "Texture, inpainted" if of_photo else "Texture, retargeted from the exemplar"))
    levels = record.get("variation_levels") or 0
    found += [(f"level-{level}", f"Variation, level {level} of {levels - 1}") for level in range(levels)]
    if levels:
        found.append(("sample", "Variation, a sample"))
    return [*found, ("street", "In the street: final texture")]


def picture(view: View, index: int, stage: str) -> np.ndarray:
    """The picture (h, w, 3) uint8 of a stage that `stages` lists. Raises InputError for another."""
    if stage not in dict(stages(view, index)):
        raise InputError(f"{view.tables.facades.id[index]}: no picture of stage {stage}")
    record = view.records[index]
    assert record is not None  # it has stages
    if stage == "source":
        return np.asarray(view.group[f"exemplars/{_exemplar(view, record['source'])}/image"])
    if stage == "rectified":
        return view.rasters(index, "facade_maps/evidence")
    if stage == "hidden":
        return overlay_hidden(view.rasters(index, "facade_maps/evidence"), view.rasters(index, "facade_maps/occluded"))
    if stage == "parse":
        return colourise(view.rasters(index, "facade_maps/labels"))
    if stage == "lattice":
        lattice = Lattice(tuple(record["lattice"]["rows"]), tuple(record["lattice"]["columns"]))
        return draw_facade(view.rasters(index, "facade_maps/labels"), lattice)
    if stage == "layout":
        return _draw_layout(
            view.rasters(index, "atlas/seed"), view.rasters(index, "facade_maps/occluded"), record["elements"]
        )
    if stage in ("texture", "street"):
        return view.rasters(index, "atlas/seed" if stage == "texture" else "atlas/colour")
    hierarchy = Hierarchy.from_bytes(base64.b64decode(view.group["hierarchies/data"][index].item()))
    if stage == "sample":
        return hierarchy.sample(len(hierarchy.levels) // 2, seed=1)
    return hierarchy.reconstruct(int(stage.removeprefix("level-")))


def encode(image: np.ndarray, kind: str = "WEBP", quality: int = 85) -> bytes:
    """An image (h, w, 3) uint8 as a file's bytes."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, kind, quality=quality)
    return buffer.getvalue()


def _exemplar(view: View, source: str | None) -> int | None:
    """Number of the exemplar that a facade was made from, None where it was seen in a picture."""
    names = [record["unit"] if record else "" for record in view.journals["exemplars"]]
    stem = Path(source or "").stem
    return names.index(stem) if stem in names else None


def _draw_layout(image: np.ndarray, hidden: np.ndarray, elements: list[list]) -> np.ndarray:
    """Elements over the texture: outlined where they were seen, filled where the completed layout put them."""
    import cv2

    times = max(1, -(-_LEAST_HEIGHT // image.shape[0]))
    drawn = np.repeat(np.repeat(image, times, axis=0), times, axis=1)
    for name, *box, _ in elements:
        x0, y0, x1, y1 = (round(value) for value in box)
        colour = COLOURS[CLASSES.index(name)] if name in CLASSES else np.full(3, 128, np.uint8)
        part = hidden[max(0, y0) : y1, max(0, x0) : x1]
        if part.size and part.mean() > _COMPLETED:
            area = drawn[max(0, y0) * times : y1 * times, max(0, x0) * times : x1 * times]
            area[:] = (0.45 * area + 0.55 * colour).astype(np.uint8)
        cv2.rectangle(drawn, (x0 * times, y0 * times), (x1 * times - 1, y1 * times - 1), colour.tolist(), 2)
    return drawn
