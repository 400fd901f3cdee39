"""Facades in the style of exemplars, which a worker keeps analysed between units: many buildings show one exemplar."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.errors import FacadeError
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.exemplar_facade import BuildingPaint, ScaledStyle, build_facade_from_exemplar
from facade_core.facade.facade import Facade
from facade_core.facade.texture.ground_floor import replace_ground_floor_by_windows, transplant_ground_floor
from facade_core.facade.texture.retargeting import ExemplarAnalysis, analyse_exemplar
from facade_core.facade.texture.roof_removal import cut_off_roof
from facade_core.plan.facade_walls import facade_wall
from tasks.engine.run import Run
from tasks.stages.exemplars.worker import read_exemplar
from tasks.stages.facades.imagery import ChosenExemplar, FacadeInputs
from tasks.stages.facades.pictured_style import PicturedStyle

# Image and labels of an exemplar, and its metres per texel.
PictureAndScale = tuple[UInt8Array, UInt8Array, float]

# Pixels of the exemplars that are kept; each takes 4 bytes, besides the tables of its lattice.
MAX_KEPT_PIXELS = 8_000_000


class _ExemplarKey(NamedTuple):
    """What an analysed exemplar depends on."""

    out: str
    exemplar: ChosenExemplar
    roof: bool


# The one used last comes last.
_kept: dict[_ExemplarKey, tuple[ExemplarAnalysis, float]] = {}


def load_exemplar_analysis(
    run: Run, group: StoreGroup, exemplar: ChosenExemplar, *, roof: bool
) -> tuple[ExemplarAnalysis, float]:
    """Return an analysed exemplar with the ground floor that it shows, and its metres per texel.

    Parameters
    ----------
    run : run of the unit.
    group : root of the store.
    exemplar : the exemplar.
    roof : whether its roof is kept, or cut off above the wall.
    """
    entry = _ExemplarKey(run.out, exemplar, roof)
    analysed = _kept.pop(entry, None)
    if analysed is None:
        image, labels, metres_per_texel = read_with_ground_floor(partial(read_exemplar, group), exemplar)
        if not roof:
            image, labels = cut_off_roof(image, labels)
        analysed = analyse_exemplar(image, labels), metres_per_texel
    _kept[entry] = analysed
    while len(_kept) > 1 and sum(style.labels.size for style, _ in _kept.values()) > MAX_KEPT_PIXELS:
        del _kept[next(iter(_kept))]
    return analysed


def read_with_ground_floor(read: Callable[[int], PictureAndScale], exemplar: ChosenExemplar) -> PictureAndScale:
    """Read an exemplar with the ground floor that it shows.

    Parameters
    ----------
    read : reads a prepared exemplar by its index, as `read_exemplar`.
    exemplar : the exemplar.
    """
    image, labels, metres_per_texel = read(exemplar.index)
    if exemplar.ground_floor == "plain":
        image, labels = replace_ground_floor_by_windows(image, labels, metres_per_texel)
    elif exemplar.ground_floor is not None:
        other_image, other_labels, theirs = read(exemplar.ground_floor.index)
        image, labels = transplant_ground_floor(image, labels, other_image, other_labels, (metres_per_texel, theirs))
    return image, labels, metres_per_texel


def build_wall_from_exemplar(
    group: StoreGroup,
    facade: int,
    inputs: FacadeInputs,
    size: tuple[int, int],
    wall_colour: Float64Array | None = None,
    own: PicturedStyle | None = None,
) -> Facade | None:
    """Build a facade in the style of its exemplar; None where walls without pictures are plain.

    Parameters
    ----------
    group : root of the store.
    facade : index of the facade.
    size : (h, w) of the raster.
    wall_colour : (3,) 0..255, of the building's walls where photos show it.
    own : style of the building's own pictured facade, taken instead of the exemplar.

    Raises
    ------
    FacadeError : the facade has no exemplar.
    """
    if inputs.walls == "translate" or not inputs.corrected.facade:
        return None
    plan, exemplar = inputs.house_view.plan, inputs.exemplar
    facades = plan.facades
    if exemplar is None:
        raise FacadeError(
            f"facade {facades.id[facade]}: no picture of it and no usable exemplar; add either to the block's imagery"
        )
    along = float(facades.along[facade])
    if own is not None:
        style, metres_per_texel = own.style, own.metres_per_pixel
    else:
        run, roof = inputs.house_view.run, not facades.roofed[facade]
        style, metres_per_texel = load_exemplar_analysis(run, group, exemplar, roof=roof)
    return build_facade_from_exemplar(
        ScaledStyle(style, metres_per_texel),
        facade_wall(plan.scene, facades, facade, inputs.entrances),
        size,
        span=(along, along + float(facades.width[facade])),
        paint=BuildingPaint(inputs.building_seed, wall_colour),
        seed=inputs.wall_seed,
    )
