"""Corrected facades of runs as training pictures and layouts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from catalogs.block.corrections import read_corrections
from catalogs.printable_text import format_count
from catalogs.published.folders import Folder
from catalogs.published.runs import find_runs
from catalogs.readers.layouts import LayoutRecord
from facade_core.atlas.rasters import read_chart_raster
from facade_core.core.arrays import BoolArray, UInt8Array
from facade_core.core.errors import InputError
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.types import Element, Shares
from facade_core.facade.correction import rasterise_boxes
from facade_core.parsing.segmenter import facade_surroundings_mask, parse
from tasks.engine.store.status import read_run_block_file
from tasks.publish.published_run import open_published_run
from tasks.stages.shared.facade_corrections import match_corrections
from training.datasets.facades import ANY_CLASS, LabelledFacade

# Fewer corrected facades do not improve the shipped models.
MIN_FACADES = 10
# Minimum share of a facade that pictures show; synthesised texture teaches the parser nothing.
MIN_PHOTO_SHARE = 0.3
# Possible classes outside elements.
_BACKGROUND_CLASSES = (FacadeClass.WALL, FacadeClass.ROOF, FacadeClass.SKY)
# Minimum confidence of the shipped network to select one of them.
_MIN_CONFIDENCE = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedFacade:
    """Facade with corrected elements.

    Attributes
    ----------
    name : "block/facade".
    image : (h, w, 3) uint8, the finished texture.
    photo_mask : (h, w) bool, True for texels from a picture.
    elements : class and box in shares of width and height, y down.
    hide : boxes of content that is not part of the facade.
    keep : boxes of facade that look like an occluder.
    """

    name: str
    image: UInt8Array
    photo_mask: BoolArray
    elements: Sequence[tuple[str, *Shares]]
    hide: Sequence[Shares] = ()
    keep: Sequence[Shares] = ()

    @property
    def boxes(self) -> tuple[Element, ...]:
        """Return the elements in texels."""
        height, width = self.photo_mask.shape
        return tuple(
            Element(label, x0 * width, y0 * height, x1 * width, y1 * height) for label, x0, y0, x1, y1 in self.elements
        )


def load_corrected_facades(outs: Iterable[Folder]) -> list[CorrectedFacade]:
    """Collect the facades of published runs whose elements were corrected.

    Parameters
    ----------
    outs : folders of one run, or of several runs each.

    Raises
    ------
    InputError : a folder has no run, or there are fewer than MIN_FACADES facades in all.
    """
    found: list[CorrectedFacade] = []
    for folder in dict.fromkeys(one.folder for out in outs for one in find_runs(out)[0]):
        found += _read_run(folder)
    if len(found) < MIN_FACADES:
        raise InputError(
            f"only {format_count(len(found), 'facade')} with corrected elements there, and at least {MIN_FACADES} are learnt "
            "from; `streetloom import` takes more"
        )
    return found


def _read_run(out: Folder) -> list[CorrectedFacade]:
    block = read_run_block_file(out)
    if block is None or not block.is_file():
        raise InputError(f"{out}: its block file {block or ''} is not there any more; corrections are kept beside it")
    found = []
    with open_published_run(out) as run:
        corrections, _ = match_corrections(run.plan, read_corrections(block), run.crs)
        for index, one in sorted(corrections.items()):
            record = run.records[index]
            if one.elements is None or not one.facade or not record or "lattice" not in record:
                continue
            chart = int(run.plan.facades.chart[index])
            image, evidence = (
                read_chart_raster(run.group, run.plan.scene.placement, chart, f"atlas/{name}")
                for name in ("seed", "seed_evidence")
            )
            found.append(
                CorrectedFacade(
                    f"{run.block}/{run.plan.facades.id[index]}",
                    image,
                    evidence == Provenance.PHOTO,
                    one.elements,
                    one.hide,
                    one.keep,
                )
            )
    return found


def label_corrected_facade(facade: CorrectedFacade) -> LabelledFacade | None:
    """Label a corrected facade for the parser's training; None if pictures show too little of it.

    Elements come from the correction alone. Wall, roof, sky, occluders and surroundings come from the shipped network, so
    that training does not unlearn them.
    """
    shown = facade.photo_mask & ~rasterise_boxes(facade.hide, facade.photo_mask.shape)
    if shown.mean() < MIN_PHOTO_SHARE:
        return None
    alpha = np.where(shown, 255, 0).astype(np.uint8)
    parsing = parse(np.dstack([facade.image, alpha]))
    outside = facade_surroundings_mask(facade.image, ~shown)
    possible = np.full(facade.photo_mask.shape, sum(1 << number for number in _BACKGROUND_CLASSES), np.uint8)
    sure = parsing.confidence.max(axis=2) >= _MIN_CONFIDENCE
    for number in _BACKGROUND_CLASSES:
        possible[sure & (parsing.labels == number)] = 1 << number
    labels = np.where(sure & np.isin(parsing.labels, _BACKGROUND_CLASSES), parsing.labels, UNKNOWN).astype(np.uint8)
    for name in ELEMENT_CLASSES:  # the order of exports: a balcony covers its window
        for e in facade.boxes:
            if e.label == name:
                box = np.s_[max(round(e.y0), 0) : round(e.y1), max(round(e.x0), 0) : round(e.x1)]
                possible[box], labels[box] = 1 << CLASSES.index(name), CLASSES.index(name)
    unknown = ~shown
    possible[unknown], labels[unknown] = ANY_CLASS, UNKNOWN
    occluder_map, outside_map = (
        np.where(unknown, UNKNOWN, mask).astype(np.uint8)
        for mask in (parsing.occluded & shown & ~rasterise_boxes(facade.keep, shown.shape), outside)
    )
    return LabelledFacade(facade.name, facade.image, labels, possible, occluder_map, outside_map)


def layout_record(facade: CorrectedFacade) -> LayoutRecord:
    """Return a corrected facade as a complete layout for training, independent of its texture."""
    height, width = facade.photo_mask.shape
    return LayoutRecord(facade.name, facade.boxes, (0.0, 0.0, float(width), float(height)), ())
