"""The stages of a facade and their pictures, described once: what the viewer and the report show, in which order, under which
names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.stored_files import read_stored_file
from facade_core.core.errors import StoreError
from facade_core.core.labels import colourise
from facade_core.core.types import Lattice
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.occlusion_overlay import overlay_hidden
from facade_core.export.pictures.rendering import draw_facade, draw_layout
from facade_core.facade.variation.hierarchy import Hierarchy
from facade_core.facade.variation.level_drawing import draw_level
from facade_core.geometry.chart_packing import Placement

# The name of the one stage that the report has of every facade.
TEXTURE = "result"
# Levels of the hierarchy that the report draws.
LEVELS_SHOWN = 3
# Sampled variations: the seeds of those that the report draws, as their files sort, and of the one that the viewer does.
SAMPLES, SAMPLE = (1, 2, 0), 1


class Shown(NamedTuple):
    """A stage where it is shown: its name in addresses and file names there, and its title."""

    name: str
    title: str


@dataclass(frozen=True)
class Stage:
    """A picture of a facade, (h, w, 3) uint8, drawn when somebody looks. viewer, report: None where it is not shown there."""

    draw: Callable[[], np.ndarray]
    viewer: Shown | None = None
    report: Shown | None = None


@dataclass(frozen=True)
class StoredFacade:
    """A facade as a snapshot of the store holds it: chart, journal record; and the exemplars of its block by name."""

    group: StoreGroup
    placement: Placement
    chart: int
    record: Mapping[str, Any] | None
    exemplars: Sequence[str]

    def raster(self, name: str) -> np.ndarray:
        """Its texels (h, w, ...) in an array of the store, such as facade_maps/labels."""
        return chart_raster(self.group, self.placement, self.chart, name)

    @cached_property
    def hidden(self) -> np.ndarray:
        """Where something stood before it, (h, w) bool."""
        return self.raster("facade_maps/occluded")

    @cached_property
    def hierarchy(self) -> Hierarchy:
        """Its variation hierarchy."""
        record = self.record or {}
        if "variation_file" not in record:
            raise StoreError("an earlier version made the variations of this facade; the next run makes them again")
        return Hierarchy.from_bytes(read_stored_file(self.group, record["variation_file"], record["variation_digest"]))

    def level(self, level: int) -> np.ndarray:
        """It at a level of its hierarchy."""
        return self.hierarchy.reconstruct(level)

    def types(self, level: int) -> np.ndarray:
        """The same, and below it the types of elements that it is made of."""
        return draw_level(self.hierarchy, level)

    def sample(self, seed: int) -> np.ndarray:
        """A variation of it, from the middle of its hierarchy."""
        return self.hierarchy.sample(len(self.hierarchy.levels) // 2, seed)


def chart_raster(group: StoreGroup, placement: Placement, chart: int, name: str) -> np.ndarray:
    """The texels (h, w, ...) of a chart in an array of the store, such as facade_maps/labels."""
    flat = read_rasters(group[name], placement, TexelLayout.of(placement, [chart]))
    return flat.reshape(int(placement.height[chart]), int(placement.width[chart]), *flat.shape[1:])


def stages_of(facade: StoredFacade) -> Iterator[Stage]:
    """The stages of a facade in their order; none before it is done."""
    record = facade.record
    if record is None or "lattice" not in record:
        return
    hidden = bool(facade.hidden.any())
    photo = hidden or (record.get("provenance") or [0])[-1] > 0
    exemplar = Path(record["source"] or "").stem
    if exemplar in facade.exemplars:
        image = f"exemplars/{facade.exemplars.index(exemplar)}/image"
        yield Stage(lambda: np.asarray(facade.group[image]), Shown("source", "Exemplar it is made from"))
    if photo:
        rectified = Shown("rectified", f"Photo, rectified{_cut(record)}")
        evidence = partial(facade.raster, "facade_maps/evidence")
        yield Stage(evidence, rectified, None if hidden else rectified)
    if hidden:
        yield Stage(
            lambda: overlay_hidden(facade.raster("facade_maps/evidence"), facade.hidden),
            Shown("hidden", "What hides the wall"),
            Shown("hidden", f"Photo{_cut(record)}, hidden part tinted"),
        )
    yield Stage(lambda: colourise(facade.raster("facade_maps/labels")), Shown("parse", "Parse"))
    lattice = Lattice(tuple(record["lattice"]["rows"]), tuple(record["lattice"]["columns"]))
    yield Stage(
        lambda: draw_facade(facade.raster("facade_maps/labels"), lattice),
        Shown("lattice", "Lattice"),
        Shown("parse", "Parse and lattice"),
    )
    yield Stage(
        lambda: draw_layout(facade.raster("atlas/seed"), facade.hidden, record["elements"]),
        Shown("layout", "Layout, completed" if photo else "Layout"),
    )
    yield Stage(
        partial(facade.raster, "atlas/seed"),
        Shown("texture", "Texture, inpainted" if photo else "Texture, retargeted from the exemplar"),
        Shown(TEXTURE, "Texture"),
    )
    yield from _variations(facade, record.get("variation_levels") or 0)
    if facade.raster("atlas/provenance").any():  # its surface is finished
        yield Stage(partial(facade.raster, "atlas/colour"), Shown("street", "In the street: final texture"))


def _cut(record: Mapping[str, Any]) -> str:
    """What of a photo was cut out as the facade, in words."""
    kept = record.get("cut_kept", 1.0)
    if not record.get("cut_found", True):
        return ", no facade found in it"
    return f" and cut to {100 * kept:.0f} % of it" if kept < 1 else ""


def _variations(facade: StoredFacade, levels: int) -> Iterator[Stage]:
    """The viewer has every level, the report some of them, with their types of elements; both have samples."""
    for level in range(levels):
        title = f"Variation, level {level} of {levels - 1}"
        yield Stage(partial(facade.level, level), Shown(f"level-{level}", title))
    for level in shown_levels(levels):
        report = Shown(f"level-{level}", f"Variation level {level}")
        yield Stage(partial(facade.types, level), report=report)
    for seed in SAMPLES if levels else ():
        yield Stage(
            partial(facade.sample, seed),
            Shown("sample", "Variation, a sample") if seed == SAMPLE else None,
            Shown(f"sample-{seed}" if seed else "sample", "Sampled variation"),
        )


def shown_levels(levels: int) -> list[int]:
    """The levels of a hierarchy that the report draws: the first, the last, and what fits between."""
    return sorted({round(i * (levels - 1) / max(1, LEVELS_SHOWN - 1)) for i in range(LEVELS_SHOWN)}) if levels else []
