"""Common exposure of the photographed facades of a building, once all of them are written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np

from facade_core.atlas.journal import Record, read_records
from facade_core.atlas.rasters import TexelLayout, chart_digests, read_chart_raster, write_rasters
from facade_core.atlas.stored_files import digest_stored_file, write_stored_file
from facade_core.core.arrays import Float64Array
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.types import Element
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.exposure import apply_tone_curve, level_wall_colours
from facade_core.facade.facade import Facade
from facade_core.facade.variation.encoding import encode
from facade_core.facade.wall_material import MIN_WALL_M2, lit_colour
from facade_core.plan.plan import Plan
from tasks.stages.facades.evidence import MIN_SHOWN_SHARE
from tasks.stages.facades.record import FacadeRecord, count_variations


def measure_pictured_colour(facade: Facade, texels_per_metre: float) -> list[float] | None:
    """Return the lit colour of the wall that a facade's pictures show, 0..255; None if they show too little.

    A part below MIN_SHOWN_SHARE can be repeated, but its panels or its brick need not be the material of the whole wall.
    """
    is_photo = facade.provenance == Provenance.PHOTO
    shown = (facade.labels == FacadeClass.WALL) & is_photo
    if is_photo.mean() < MIN_SHOWN_SHARE or shown.sum() < MIN_WALL_M2 * texels_per_metre**2:
        return None
    return [round(float(value), 1) for value in lit_colour(facade.image[shown])]


def level_exposures(
    group: StoreGroup, plan: Plan, records: dict[int, Record], neighbours: Mapping[int, Callable[[], Sequence[int]]]
) -> None:
    """Bring the photographed facades of a building to one exposure, in the store and in their records.

    Parameters
    ----------
    group : root of the store, with the facades as they are pictured.
    plan : its plan.
    records : records of the facades that were written now; changed in place.
    neighbours : of each of them, returns the other facades of its building with pictures.
    """
    for facade in neighbours:
        own = _find_pictured_wall(records.get(facade))
        if own is None:
            continue
        others = [
            _find_pictured_wall(records.get(other) or read_records(group, "facades", np.array([other]))[0])
            for other in neighbours[facade]()
        ]
        walls = [own, *(wall for wall in others if wall is not None)]
        slope = level_wall_colours([wall.colour for wall in walls], [wall.exposure for wall in walls])[0]
        if (slope != 1).any():
            _lighten(group, plan, facade, cast(FacadeRecord, records[facade]), slope)


class _PicturedWall(NamedTuple):
    """Lit colour of a wall, 0..255, and what has its exposure: the common one, or its first picture, which shows it best."""

    colour: Float64Array
    exposure: str


def _find_pictured_wall(record: Record | None) -> _PicturedWall | None:
    if record is None or record["status"] != "done":
        return None
    facade = cast(FacadeRecord, record)
    if "pictured_colour" not in facade:
        return None
    exposure = "" if facade.get("common_exposure") else first_picture(facade["source"])
    return _PicturedWall(np.array(facade["pictured_colour"], np.float64), exposure)


def first_picture(source: str) -> str:
    """Return the first of the pictures that a facade is made from, which shows it best."""
    return source.split(", ")[0]


def _lighten(group: StoreGroup, plan: Plan, facade: int, record: FacadeRecord, slope: Float64Array) -> None:
    """Apply a tone curve to the rasters and the variations of a facade."""
    scene, chart = plan.scene, int(plan.facades.chart[facade])
    rasters = TexelLayout.of_charts(scene.placement, [chart])
    has_variations = "variation_file" in record
    for name in ("atlas/seed", *(["facade_maps/evidence"] if has_variations else [])):
        image = apply_tone_curve(read_chart_raster(group, scene.placement, chart, name), slope)
        write_rasters(group[name], scene.spec, scene.placement, rasters, image.reshape(-1, 3))
    image = read_chart_raster(group, scene.placement, chart, "atlas/seed")
    evidence = read_chart_raster(group, scene.placement, chart, "atlas/seed_evidence")
    record["digests"] = chart_digests(image.reshape(-1, 3), evidence.reshape(-1), scene.placement, rasters, plan.ids)
    record["tone_slope"] = [round(float(value), 3) for value in slope]
    if has_variations:
        hierarchy = encode(image, [Element(*row) for row in record["elements"]])
        file = hierarchy.to_bytes()
        write_stored_file(group, record["variation_file"], file, f"variations of {plan.facades.id[facade]}")
        record["variation_digest"] = record["files"][record["variation_file"]] = digest_stored_file(file)
        cast(dict[str, object], record).update(count_variations(hierarchy))
