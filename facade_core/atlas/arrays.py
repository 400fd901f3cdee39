"""Declaration of a store's arrays: creating, resizing and opening them follows from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from facade_core.atlas.journal import journal_path
from facade_core.atlas.rasters import TexelLayout, write_rasters
from facade_core.atlas.stored_files import FOLDERS
from facade_core.core.atlas_spec import STRING_DTYPE, ArraySpec, AtlasSpec, DimensionAndChunkSize
from facade_core.core.labels import FLAGS
from facade_core.core.provenance import PROVENANCE
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.chart_packing import ChartPlacements

# Format of a store, kept in its attributes. Increase it when the layout of tables, arrays or records changes; the next
# run then recreates stores of other formats.
STORE_FORMAT = 7

PAGE_DIMS = ("page", "y", "x")
PAGE_RGB_DIMS = ("page", "y", "x", "band")
PROVENANCE_FLAGS = {"flag_values": list(range(len(PROVENANCE))), "flag_meanings": " ".join(PROVENANCE)}

# Arrays over the pages of the atlas, by writer. Colour and its provenance come first: records keep a digest of these
# two per chart.
BASE_ARRAYS = (
    ArraySpec(
        "atlas/seed", PAGE_RGB_DIMS, "uint8", "colour from the facade stages", {"ancillary_variables": "seed_evidence"}
    ),
    ArraySpec("atlas/seed_evidence", PAGE_DIMS, "uint8", "provenance of seed, 0 where there is none", PROVENANCE_FLAGS),
    ArraySpec("facade_maps/evidence", PAGE_RGB_DIMS, "uint8", "facade image before completion"),
    ArraySpec(
        "facade_maps/labels",
        PAGE_DIMS,
        "uint8",
        "class id as in streetloom.labels, 255 unknown",
        {**FLAGS, "ancillary_variables": "confidence occluded"},
    ),
    ArraySpec("facade_maps/occluded", PAGE_DIMS, "bool", "hidden in the facade image"),
    ArraySpec(
        "facade_maps/confidence",
        PAGE_DIMS,
        "uint8",
        "how well a picture shows it: 255 squarely at the atlas's resolution, 0 not at all",
        {"units": "1"},
    ),
    ArraySpec(
        "facade_maps/camera", PAGE_DIMS, "uint16", "which of the cameras in its record it is from, from 1 on; 0 none"
    ),
)
SURFACE_ARRAYS = (
    ArraySpec("atlas/colour", PAGE_RGB_DIMS, "uint8", "resolved colour", {"ancillary_variables": "provenance"}),
    ArraySpec(
        "atlas/provenance",
        PAGE_DIMS,
        "uint8",
        "source of colour: " + ", ".join(f"{rank} {source}" for rank, source in enumerate(PROVENANCE)),
        PROVENANCE_FLAGS,
    ),
    ArraySpec(
        "atlas/street_views", PAGE_DIMS, "uint16", "views of streets that decided colour by Eq. 1", {"units": "1"}
    ),
)
STAGE_ARRAYS = {
    "textures": BASE_ARRAYS,
    "grounds": BASE_ARRAYS,
    "walls": BASE_ARRAYS,
    "facades": BASE_ARRAYS,
    "surfaces": SURFACE_ARRAYS,
}

ARRAYS = (*BASE_ARRAYS, *SURFACE_ARRAYS)


def journal_array_spec(stage: str) -> ArraySpec:
    """Return the specification of the array that holds a stage's records, one per unit."""
    meaning = f"record of each unit of {stage}, JSON; empty until it is done"
    return ArraySpec(journal_path(stage), (_unit_dimension(stage),), STRING_DTYPE, meaning)


def create_arrays(group: StoreGroup, spec: AtlasSpec, units: Mapping[str, int], *, crs: str) -> None:
    """Create empty atlas pages, facade maps and journals; no chunk is written.

    Parameters
    ----------
    group : root group of the store.
    spec : size of pages and chunks.
    units : number of units by stage.
    crs : coordinate reference system of the block.
    """
    axes = _axes(spec, units)
    for array in (*ARRAYS, *map(journal_array_spec, units)):
        array.create(group, axes)
    for folder in ("atlas", "facade_maps"):
        group.require_group(folder).attrs.update(
            crs=crs, texels_per_metre=spec.texels_per_metre, gutter=spec.gutter, units="texel"
        )
    for folder in FOLDERS:
        group.create_group(folder, overwrite=True)
    group.attrs.update(format=STORE_FORMAT)


def resize_arrays(group: StoreGroup, spec: AtlasSpec, units: Mapping[str, int]) -> None:
    """Resize the arrays of `create_arrays` to other numbers of pages and units.

    Content that is inside both sizes stays.

    Parameters
    ----------
    group : root group of the store.
    spec : size of pages and chunks.
    units : number of units by stage.
    """
    axes = _axes(spec, units)
    for array in (*ARRAYS, *map(journal_array_spec, units)):
        array.resize(group, axes)
    for folder in FOLDERS:
        group.require_group(folder)
    group.attrs.update(format=STORE_FORMAT)


def clear_rasters(
    group: StoreGroup, spec: AtlasSpec, placement: ChartPlacements, charts: Iterable[int], stage: str | None = None
) -> None:
    """Reset the atlas and the facade maps at some charts to their state before a stage.

    Parameters
    ----------
    group : root group of the store.
    spec : size of pages and chunks.
    placement : place of every chart on the pages.
    charts : rows of the charts to clear.
    stage : clears the arrays of this stage only; None clears those of all stages.
    """
    arrays = [group[array.path] for array in (STAGE_ARRAYS[stage] if stage else ARRAYS)]
    for chart in charts:
        layout = TexelLayout.of_charts(placement, [chart])
        for array in arrays:
            write_rasters(array, spec, placement, layout, np.zeros((layout.total, *array.shape[3:]), array.dtype))


def _axes(spec: AtlasSpec, units: Mapping[str, int]) -> dict[str, DimensionAndChunkSize]:
    """Return every dimension of `ARRAYS` and of the journal.

    A chunk is a square of a page, or the output of one unit.
    """
    return {
        **{_unit_dimension(stage): DimensionAndChunkSize(count, 1) for stage, count in units.items()},
        "page": DimensionAndChunkSize(spec.pages, 1),
        "y": DimensionAndChunkSize(spec.page, spec.chunk),
        "x": DimensionAndChunkSize(spec.page, spec.chunk),
        "band": DimensionAndChunkSize(3, 3),
    }


def _unit_dimension(stage: str) -> str:
    return stage.removesuffix("s")
