"""Pictures of the stages of a facade, defined once for the viewer and the report, with their order and names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from facade_core.atlas.rasters import read_chart_raster
from facade_core.atlas.stored_files import read_stored_file
from facade_core.core.arrays import AnyArray, BoolArray, UInt8Array
from facade_core.core.errors import StoreError
from facade_core.core.labels import colourise
from facade_core.core.types import Lattice
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.occlusion_overlay import overlay_occlusion
from facade_core.export.pictures.rendering import draw_layout, draw_parse
from facade_core.facade.stored_record import StoredFacadeRecord
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.level_drawing import draw_level
from facade_core.geometry.chart_packing import ChartPlacements

# Name of the one stage that the report has of every facade.
TEXTURE_STAGE = "result"
# Seeds of the sampled variations in the report, in the order of their files; the viewer shows the first.
REPORT_SAMPLE_SEEDS = (1, 2, 0)


class StageTitle(NamedTuple):
    """Name of a stage in addresses and file names, and its title for readers."""

    name: str
    title: str


@dataclass(frozen=True)
class StagePicture:
    """Picture of a stage, drawn on demand.

    Attributes
    ----------
    draw : draws the picture (h, w, 3) uint8.
    viewer, report : name and title there; None where it is not shown.
    """

    draw: Callable[[], UInt8Array]
    viewer: StageTitle | None = None
    report: StageTitle | None = None


@dataclass(frozen=True)
class StoredFacade:
    """Facade in a snapshot of the store.

    Attributes
    ----------
    group : group of the store.
    placement : placement of the charts.
    chart : chart of the facade.
    record : journal record; None before it is done.
    exemplars : folder of each prepared exemplar, by its name.
    """

    group: StoreGroup
    placement: ChartPlacements
    chart: int
    record: StoredFacadeRecord | None
    exemplars: Mapping[str, str]

    def read_raster(self, name: str) -> AnyArray:
        """Read the texels (h, w, ...) of the facade in an array of the store, such as facade_maps/labels."""
        return read_chart_raster(self.group, self.placement, self.chart, name)

    @cached_property
    def occlusion_mask(self) -> BoolArray:
        """Return the mask (h, w) bool of occluders."""
        return self.read_raster("facade_maps/occluded")

    @cached_property
    def hierarchy(self) -> Hierarchy:
        """Return the variation hierarchy."""
        record = self.record
        if record is None or "variation_file" not in record:
            raise StoreError("this facade has no stored variations; run the block again")
        return Hierarchy.from_bytes(read_stored_file(self.group, record["variation_file"], record["variation_digest"]))

    def reconstruct_level(self, level: int) -> UInt8Array:
        """Reconstruct the facade at a level of its hierarchy."""
        return self.hierarchy.reconstruct(level)

    def draw_types(self, level: int) -> UInt8Array:
        """Draw the facade at a level, with its element types below."""
        return draw_level(self.hierarchy, level)

    def draw_sample(self, seed: int) -> UInt8Array:
        """Draw a variation from the middle of the hierarchy."""
        return self.hierarchy.sample(len(self.hierarchy.levels) // 2, seed)


def iterate_stage_pictures(facade: StoredFacade) -> Iterator[StagePicture]:
    """Iterate over the stages of a facade in their order; empty before it is done."""
    record = facade.record
    if record is None or "lattice" not in record:
        return
    hidden = bool(facade.occlusion_mask.any())
    photo = hidden or (record.get("provenance") or [0])[-1] > 0
    exemplar = Path((record["source"] or "").split(", ")[0]).stem  # the second is of its ground floor
    if exemplar in facade.exemplars:
        image = f"{facade.exemplars[exemplar]}/image"
        yield StagePicture(lambda: np.asarray(facade.group[image]), StageTitle("source", "Exemplar it is made from"))
    if photo:
        yield from _photo_pictures(facade, record, hidden)
    yield StagePicture(lambda: colourise(facade.read_raster("facade_maps/labels")), StageTitle("parse", "Parse"))
    yield from _layout_pictures(facade, record, photo)
    yield from _variation_pictures(facade, record.get("variation_levels") or 0)
    if facade.read_raster("atlas/provenance").any():  # its surface is finished
        yield StagePicture(
            partial(facade.read_raster, "atlas/colour"), StageTitle("street", "In the street: final texture")
        )


def _photo_pictures(facade: StoredFacade, record: StoredFacadeRecord, hidden: bool) -> Iterator[StagePicture]:
    """Yield the rectified photo, and what hides its wall."""
    rectified = StageTitle("rectified", f"Photo, rectified{_crop_note(record)}")
    evidence = partial(facade.read_raster, "facade_maps/evidence")
    yield StagePicture(evidence, rectified, None if hidden else rectified)
    if hidden:
        yield StagePicture(
            lambda: overlay_occlusion(facade.read_raster("facade_maps/evidence"), facade.occlusion_mask),
            StageTitle("hidden", "What hides the wall"),
            StageTitle("hidden", f"Photo{_crop_note(record)}, hidden part tinted"),
        )


def _layout_pictures(facade: StoredFacade, record: StoredFacadeRecord, photo: bool) -> Iterator[StagePicture]:
    """Yield lattice, layout and texture."""
    lattice = Lattice(tuple(record["lattice"]["rows"]), tuple(record["lattice"]["columns"]))
    yield StagePicture(
        lambda: draw_parse(facade.read_raster("facade_maps/labels"), lattice),
        StageTitle("lattice", "Lattice"),
        StageTitle("parse", "Parse and lattice"),
    )
    yield StagePicture(
        lambda: draw_layout(facade.read_raster("atlas/seed"), facade.occlusion_mask, record["elements"]),
        StageTitle("layout", "Layout, completed" if photo else "Layout"),
    )
    yield StagePicture(
        partial(facade.read_raster, "atlas/seed"),
        StageTitle("texture", "Texture, inpainted" if photo else "Texture, retargeted from the exemplar"),
        StageTitle(TEXTURE_STAGE, "Texture"),
    )


def _crop_note(record: StoredFacadeRecord) -> str:
    """Describe in words how a photo was cropped to the facade."""
    kept = record.get("cut_kept", 1.0)
    if not record.get("cut_found", True):
        return ", no facade found in it"
    notes = "".join(f"; {note}" for note in record.get("cut_notes", ()))
    return (f" and cut to {100 * kept:.0f} % of it" if kept < 1 else "") + notes


def _variation_pictures(facade: StoredFacade, levels: int) -> Iterator[StagePicture]:
    """Yield every level for the viewer, some levels with element types for the report, and samples for both."""
    for level in range(levels):
        title = f"Variation, level {level} of {levels - 1}"
        yield StagePicture(partial(facade.reconstruct_level, level), StageTitle(f"level-{level}", title))
    for level in select_report_levels(levels):
        report = StageTitle(f"level-{level}", f"Variation level {level}")
        yield StagePicture(partial(facade.draw_types, level), report=report)
    for seed in REPORT_SAMPLE_SEEDS if levels else ():
        yield StagePicture(
            partial(facade.draw_sample, seed),
            StageTitle("sample", "Variation, a sample") if seed == REPORT_SAMPLE_SEEDS[0] else None,
            StageTitle(f"sample-{seed}" if seed else "sample", "Sampled variation"),
        )


def select_report_levels(levels: int, most: int = 3) -> list[int]:
    """Select the levels of a hierarchy for the report: the first, the last, and evenly spaced ones between."""
    return sorted({round(i * (levels - 1) / max(1, most - 1)) for i in range(most)}) if levels else []
