"""Ground floor of an exemplar: another's, or a plain one."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np

from facade_core.core.arrays import Float64Array, UInt8Array
from facade_core.core.labels import FacadeClass
from facade_core.facade.texture.doors import fill_with_door
from facade_core.facade.texture.ground_units import arrange_units, compose_units, find_ground_units
from facade_core.facade.texture.roof_removal import cut_off_roof
from facade_core.facade.texture.settings import ENTRANCES, FLOORS, GROUND_FLOOR
from facade_core.facade.wall_material import lit_colour, paint_plaster
from facade_core.parsing.floor_structure import FloorsAndBays, find_floors_and_bays, spans_above_threshold


def transplant_ground_floor(
    image: UInt8Array,
    labels: UInt8Array,
    other_image: UInt8Array,
    other_labels: UInt8Array,
    metres_per_pixel: tuple[float, float],
) -> tuple[UInt8Array, UInt8Array]:
    """Replace the ground floor of an exemplar by another exemplar's, in its own light and the colour of its own wall.

    Its elements are arranged whole; where they do not fit, it is plain. Without windows in either nothing changes.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    other_image : (h, w, 3) uint8, the other exemplar.
    other_labels : (h, w) uint8.
    metres_per_pixel : scales of the exemplar and of the other.

    Returns
    -------
    Image and labels, as high as upper floors and the new ground floor together.
    """
    own, other = find_floors_and_bays(labels), find_floors_and_bays(other_labels)
    if own is None or other is None or other.ground_top >= other.bottom or own.ground_top <= own.top:
        return image, labels
    rows, scale = slice(other.ground_top, other.bottom), metres_per_pixel[1] / metres_per_pixel[0]
    height = max(1, round((other.bottom - other.ground_top) * scale))
    gain = _wall_gain(
        _wall_colour(image, labels, _lowest_upper_floor(own)),
        _wall_colour(other_image, other_labels, _lowest_upper_floor(other)),
    )
    is_wall = other_labels[rows] == FacadeClass.WALL
    lit = other_image[rows] * np.where(is_wall[..., None], gain, gain.mean())
    source = np.clip(np.rint(lit), 0, 255).astype(np.uint8), other_labels[rows]
    units, width = find_ground_units(*source, metres_per_pixel[1]), labels.shape[1]
    wide, rng = width * metres_per_pixel[0], np.random.default_rng(0)
    if units is None or (arranged := arrange_units(units, wide, metres_per_pixel[1], rng)) is None:
        return replace_ground_floor_by_windows(image, labels, metres_per_pixel[0])
    borders = np.array([0, len(source[1])]), np.array([0, height])
    ground = compose_units(source, units, arranged, borders, width, metres_per_pixel[::-1])
    above = slice(0, own.ground_top)
    return np.concatenate([image[above], ground[0]]), np.concatenate([labels[above], ground[1]])


def _wall_gain(colour: Float64Array | None, other: Float64Array | None) -> Float64Array:
    """Return the factors (3,) from another wall's colour to a wall's; ones where either is unknown."""
    if colour is None or other is None:
        return np.ones(3)
    gain = colour / np.maximum(other, 1)
    light = float(np.clip(gain.mean(), 1 / GROUND_FLOOR.max_gain, GROUND_FLOOR.max_gain))
    return np.asarray(light * np.clip(gain / gain.mean(), 1 / GROUND_FLOOR.max_tint, GROUND_FLOOR.max_tint))


def _wall_colour(image: UInt8Array, labels: UInt8Array, rows: slice) -> Float64Array | None:
    """Return the colour (3,) of the wall in some rows; None without any."""
    wall = labels[rows] == FacadeClass.WALL
    return lit_colour(image[rows][wall]) if wall.any() else None


def _lowest_upper_floor(found: FloorsAndBays) -> slice:
    """Return the rows of the floor above the ground floor."""
    return slice(max(cut for cut in found.floor_cuts if cut < found.ground_top), found.ground_top)


def replace_ground_floor_by_windows(
    image: UInt8Array, labels: UInt8Array, metres_per_pixel: float
) -> tuple[UInt8Array, UInt8Array]:
    """Replace the whole ground floor of an exemplar by windows of an upper floor, with a plain door in a middle bay.

    Where the picture cuts the ground floor off, the lowest of several floors is one.

    Parameters
    ----------
    image : (H, W, 3) uint8.
    labels : (H, W) uint8 class ids.
    metres_per_pixel : scale of the exemplar.
    """
    found = find_floors_and_bays(labels)
    if found is None:
        return image, labels
    if "middle" in found.kinds[:-1] and not (found.kinds[-1] == "ground" or found.has_ground_band):
        found = replace(found, kinds=(*found.kinds[:-1], "ground"), ground_top=found.floor_cuts[-2])
    new_image, new_labels = _show_windows(image, labels, found, metres_per_pixel)
    found = replace(found, bottom=len(new_labels))
    wide = np.diff(found.bays, axis=1)[:, 0]
    is_pair = wide > GROUND_FLOOR.max_door_bay * np.median(wide)  # windows without a pier between them
    bay = min(range(len(wide)), key=lambda number: (is_pair[number], abs(number - len(wide) // 2)))
    at = slice(found.ground_top, found.bottom), slice(*found.bay_cuts[bay : bay + 2])
    rng = np.random.default_rng(int(image.sum(dtype=np.uint64)))
    _open_door(new_image[at], new_labels[at], sum(found.bays[bay]) // 2 - at[1].start, metres_per_pixel, rng)
    return new_image, new_labels


def _open_door(
    image: UInt8Array, labels: UInt8Array, middle: int, metres_per_pixel: float, rng: np.random.Generator
) -> None:
    """Lead the window of a bay down to the ground, with its surround, and set a door below its head, in place.

    Parameters
    ----------
    image, labels : the bay of the ground floor.
    middle : column of the middle of its opening; a bay without a window gets a door there.
    """
    wide, high = (round(side / metres_per_pixel) for side in ENTRANCES.door_size_m)
    reach, foot = round(ENTRANCES.door_margin_m / metres_per_pixel), len(labels)
    columns, head = slice(max(0, middle - wide // 2), middle + wide // 2), max(0, foot - high)
    glass = labels == FacadeClass.WINDOW
    if glass.any():
        spans = spans_above_threshold(glass.mean(axis=0), 0.5 * float(glass.mean(axis=0).max()))
        left, right = max(spans, key=lambda span: span[1] - span[0])
        rows = np.flatnonzero(glass[:, left:right].any(axis=1))
        spare = max(0, wide - reach - (right - left))  # a door is not as narrow as some windows
        columns = slice(max(0, left - spare // 2), right + spare // 2)
        jambs = np.r_[
            max(0, columns.start - reach) : columns.start, columns.stop : min(columns.stop + reach, labels.shape[1])
        ]
        beside = np.arange(rows[0], max(rows[0] + 1, (rows[0] + rows[-1]) // 2))
        jambs = jambs[(labels[np.ix_(beside, jambs)] == FacadeClass.WALL).all(axis=0)]
        below = np.arange(beside[-1] + 1, foot)
        image[np.ix_(below, jambs)] = image[np.ix_(np.resize(np.append(beside[::-1], beside), len(below)), jambs)]
        labels[np.ix_(below, jambs)] = FacadeClass.WALL
        if head - rows[0] < ENTRANCES.min_fanlight_m / metres_per_pixel:
            head = max(0, min(head, int(rows[0])))
    fill_with_door(image, labels, (slice(head, foot), columns), metres_per_pixel, rng)


def _residential_floor(found: FloorsAndBays, labels: UInt8Array) -> slice:
    """Return the rows of the lowest floor with the least of balconies and roof, if possible not the topmost."""
    middle = [i for i, kind in enumerate(found.kinds) if kind == "middle"]
    floors = [slice(*found.floor_cuts[i : i + 2]) for i in (middle[1:] or middle)[::-1]]
    return min(floors, key=lambda rows: float(np.isin(labels[rows], (FacadeClass.BALCONY, FacadeClass.ROOF)).mean()))


def _end_on_wall(image: UInt8Array, labels: UInt8Array, metres_per_pixel: float) -> tuple[UInt8Array, UInt8Array]:
    """Plaster what is below the windows of a floor, such as cornices and corbels, in the colour of the wall beside them.

    A balustrade along the floor goes too, with the windows behind it.
    """
    window = np.flatnonzero((labels == FacadeClass.WINDOW).any(axis=1))
    shown = np.flatnonzero(np.isin(labels, (FacadeClass.WINDOW, FacadeClass.BALCONY)).any(axis=1))
    balcony = labels == FacadeClass.BALCONY
    if (balustrade := balcony.mean(axis=1) > GROUND_FLOOR.min_balustrade_share).any():
        shown = shown[shown < np.flatnonzero(balustrade)[0]]
    sill = round(GROUND_FLOOR.sill_m / metres_per_pixel)
    if not (len(window) and len(shown)) or (missing := len(labels) - int(shown[-1]) - 1 - sill) <= 0:
        return image, labels
    band = slice(int(window[0]), min(int(window[-1]), int(shown[-1])) + 1)
    is_wall = labels[band] == FacadeClass.WALL
    if not is_wall.any():
        return image, labels
    colour = np.median(image[band][is_wall], axis=0)
    image, labels = image.copy(), labels.copy()
    image[-missing:] = paint_plaster((missing, labels.shape[1]), colour, FLOORS.grain)
    labels[-missing:] = FacadeClass.WALL
    return image, labels


def _show_windows(
    image: UInt8Array, labels: UInt8Array, found: FloorsAndBays, metres_per_pixel: float
) -> tuple[UInt8Array, UInt8Array]:
    """Show a residential floor without its roof in place of the ground floor, in the light of the floor above."""
    top, source_rows = found.ground_top, _residential_floor(found, labels)
    roof = len(labels) - len(cut_off_roof(image, labels)[1])
    source_rows = slice(max(roof, source_rows.start), source_rows.stop)
    height, cuts = source_rows.stop - source_rows.start, (0, *found.bay_cuts[1:-1], labels.shape[1])
    bays = [slice(a, b) for a, b in pairwise(cuts)]
    plain = [not (labels[source_rows, bay] == FacadeClass.BALCONY).any() for bay in bays]
    gain = _wall_gain(_wall_colour(image, labels, _lowest_upper_floor(found)), _wall_colour(image, labels, source_rows))
    copied = _end_on_wall(image[source_rows], labels[source_rows], metres_per_pixel)
    new_image, new_labels = (
        np.concatenate([one[:top], np.empty((height, *one.shape[1:]), np.uint8)]) for one in (image, labels)
    )
    for number, bay in enumerate(bays):
        # The nearest bay without balconies, the bay itself first.
        nearest = min(range(len(bays)), key=lambda other: (any(plain) and not plain[other], abs(other - number)))
        source = np.clip(np.rint(copied[0][:, bays[nearest]] * gain), 0, 255).astype(np.uint8)
        _paste((new_image[top:, bay], new_labels[top:, bay]), (source, copied[1][:, bays[nearest]]))
    return new_image, new_labels


def _paste(target: tuple[UInt8Array, UInt8Array], source: tuple[UInt8Array, UInt8Array]) -> None:
    """Fill image and labels of a target with those of a source, stretched to its size."""
    size = target[1].shape[::-1]
    target[0][:] = cv2.resize(source[0], size, interpolation=cv2.INTER_AREA)
    target[1][:] = cv2.resize(source[1], size, interpolation=cv2.INTER_NEAREST)
