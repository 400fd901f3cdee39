"""The arrays of a store, declared once: what is created, resized and opened of them follows from here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from facade_core.atlas.rasters import Rasters, write_rasters
from facade_core.atlas.stored_files import FOLDERS
from facade_core.core.atlas_spec import TEXT, Array, AtlasSpec, Axis
from facade_core.core.labels import FLAGS
from facade_core.core.provenance import PROVENANCE
from facade_core.core.zarr_types import StoreGroup
from facade_core.geometry.chart_packing import Placement

# Of what stores hold, in an attribute of theirs: raised when tables, arrays or records are written in another way. A store of
# another format begins anew at the next run.
FORMAT = 4

PAGE, PAGE_RGB = ("page", "y", "x"), ("page", "y", "x", "band")
FROM = {"flag_values": list(range(len(PROVENANCE))), "flag_meanings": " ".join(PROVENANCE)}

# Arrays over the pages of the atlas, by who writes them. The colours of each, and what these are from, come first: records have
# the digests of these two, chart by chart.
SEEDS = (
    Array("atlas/seed", PAGE_RGB, "uint8", "colour from the facade stages", {"ancillary_variables": "seed_evidence"}),
    Array("atlas/seed_evidence", PAGE, "uint8", "provenance of seed, 0 where there is none", FROM),
    Array("facade_maps/evidence", PAGE_RGB, "uint8", "facade image before completion"),
    Array(
        "facade_maps/labels",
        PAGE,
        "uint8",
        "class id as in facade_core.labels, 255 unknown",
        {**FLAGS, "ancillary_variables": "confidence occluded"},
    ),
    Array("facade_maps/occluded", PAGE, "bool", "hidden in the facade image"),
    Array(
        "facade_maps/confidence",
        PAGE,
        "uint8",
        "how well a picture shows it: 255 squarely at the atlas's resolution, 0 not at all",
        {"units": "1"},
    ),
    Array("facade_maps/camera", PAGE, "uint16", "which of the cameras in its record it is from, from 1 on; 0 none"),
)
STREETS = (
    Array(
        "atlas/street",
        PAGE_RGB,
        "uint8",
        "colour from the street stage, Eq. 1",
        {"ancillary_variables": "street_views"},
    ),
    Array("atlas/street_views", PAGE, "uint16", "views blended into street", {"units": "1"}),
)
SURFACES = (
    Array("atlas/colour", PAGE_RGB, "uint8", "resolved colour", {"ancillary_variables": "provenance"}),
    Array(
        "atlas/provenance",
        PAGE,
        "uint8",
        "source of colour: " + ", ".join(f"{rank} {source}" for rank, source in enumerate(PROVENANCE)),
        FROM,
    ),
)
OF_STAGE = {
    "textures": SEEDS,
    "grounds": SEEDS,
    "walls": SEEDS,
    "facades": SEEDS,
    "streets": STREETS,
    "surfaces": SURFACES,
}

ARRAYS = (
    *SEEDS,
    *STREETS,
    *SURFACES,
    Array(
        "panoramas/rgb",
        ("viewpoint", "row", "column", "band"),
        "uint8",
        "translated equirectangular panorama; the truth of street texturing",
    ),
)


def journal(stage: str) -> Array:
    """The array of the records of a stage, one a unit."""
    meaning = f"record of each unit of {stage}, JSON; empty until it is done"
    return Array(f"journal/{stage}", (_unit(stage),), TEXT, meaning)


def create_arrays(
    group: StoreGroup, spec: AtlasSpec, units: Mapping[str, int], *, crs: str, panorama_width: int
) -> None:
    """Empty atlas pages, facade maps, panoramas and journal, for so many units by stage: no chunk is written."""
    axes = _axes(spec, units, panorama_width)
    for array in (*ARRAYS, *map(journal, units)):
        array.create(group, axes)
    for folder in ("atlas", "facade_maps"):
        group.require_group(folder).attrs.update(
            crs=crs, texels_per_metre=spec.texels_per_metre, gutter=spec.gutter, units="texel"
        )
    group.require_group("panoramas").attrs.update(crs=crs)
    for exemplar in range(units["exemplars"]):  # units that run side by side must not create the same group
        group.create_group(f"exemplars/{exemplar}", overwrite=True)
    for folder in FOLDERS:
        group.create_group(folder, overwrite=True)
    group.attrs.update(format=FORMAT)


def resize_arrays(group: StoreGroup, spec: AtlasSpec, units: Mapping[str, int], *, panorama_width: int) -> None:
    """The arrays of `create_arrays` for other numbers of pages and of units by stage.

    What is in both keeps its content, but for panoramas of another width, which begin anew.
    """
    axes = _axes(spec, units, panorama_width)
    for array in (*ARRAYS, *map(journal, units)):
        array.fit(group, axes)
    for exemplar in range(units["exemplars"]):
        group.require_group(f"exemplars/{exemplar}")
    for folder in FOLDERS:
        group.require_group(folder)
    group.attrs.update(format=FORMAT)


def clear_rasters(
    group: StoreGroup, spec: AtlasSpec, placement: Placement, charts: Iterable[int], stage: str | None = None
) -> None:
    """Make the atlas and the facade maps at some charts as they were before a stage wrote them; without one, before any did."""
    arrays = [
        group[array.path]
        for array in (OF_STAGE[stage] if stage else (*SEEDS, *STREETS, *SURFACES))
        if array.path in group  # a store of an earlier version lacks some until its plan is written
    ]
    for chart in charts:
        one = Rasters.of(placement, [chart])
        for array in arrays:
            write_rasters(array, spec, placement, one, np.zeros((one.total, *array.shape[3:]), array.dtype))


def _axes(spec: AtlasSpec, units: Mapping[str, int], panorama_width: int) -> dict[str, Axis]:
    """Every dimension of ARRAYS and of the journal: a chunk is a square of a page, a panorama, or what one unit writes."""
    return {
        **{_unit(stage): Axis(count, 1) for stage, count in units.items()},
        "page": Axis(spec.pages, 1),
        "y": Axis(spec.page, spec.chunk),
        "x": Axis(spec.page, spec.chunk),
        "band": Axis(3, 3),
        "row": Axis(panorama_width // 2, panorama_width // 2),
        "column": Axis(panorama_width, panorama_width),
    }


def _unit(stage: str) -> str:
    return stage.removesuffix("s")
