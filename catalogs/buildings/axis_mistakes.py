"""Coordinates that make sense once their axes are swapped, or are of another frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from catalogs.buildings.settings import SITES
from catalogs.crs import LONLAT, coordinate_transform, note_outside_area_of_use
from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.errors import InputError

if TYPE_CHECKING:
    from pyproj import CRS

# Fault of an area that holds something once its longitudes and latitudes are swapped.
SWAPPED_AXES_NOTE = "latitudes come first there"


def axis_mistake(frame: CRS, boxes: Float64Array) -> str | None:
    """Return the likely mistake of boxes that all lie nowhere, or outside the area where their CRS is used.

    Parameters
    ----------
    frame : CRS of the boxes.
    boxes : (n, 4) of (xmin, ymin, xmax, ymax).

    Returns
    -------
    The mistake and the remedy; None where no box lies inside after a change, or one does without.
    """
    middle = np.column_stack([boxes[:, [0, 2]].mean(axis=1), boxes[:, [1, 3]].mean(axis=1)])
    if not len(middle):
        return None
    x, y = np.median(middle, axis=0).tolist()
    if not frame.is_geographic and looks_like_degrees(boxes):
        return f"coordinates (as in {x:.7g}, {y:.7g}) look like degrees; name their frame, such as EPSG:4326"
    if _is_in_use(frame, middle).any():
        return None
    if _is_in_use(frame, middle[:, ::-1]).all():
        axes = ("longitude", "latitude") if frame.is_geographic else ("x", "y")
        return f"{axes[0]} and {axes[1]} look swapped (the first number is {x:.7g}, the second {y:.7g}); write {axes[0]} first"
    return None


def looks_like_degrees(boxes: Float64Array) -> bool:
    """Return True for boxes (n, 4) of buildings in degrees, longitude first."""
    if not len(boxes):
        return False
    sizes = (boxes[:, 2:] - boxes[:, :2]).max(axis=1)
    return bool((np.abs(boxes) <= (180.0, 90.0, 180.0, 90.0)).all() and np.median(sizes) < SITES.max_median_size_deg)


def note_local_coordinates(frame: CRS, extent: Sequence[float]) -> tuple[str, ...]:
    """Return a note on buildings near the origin of a frame, outside its area, as those of a frame of their own are.

    Parameters
    ----------
    frame : projected CRS of the block.
    extent : (xmin, ymin, xmax, ymax) around the buildings, metres.
    """
    area = frame.area_of_use
    if area is None or max(map(abs, extent)) > SITES.max_local_coordinate:
        return ()
    middle = np.array([[(extent[0] + extent[2]) / 2, (extent[1] + extent[3]) / 2]])
    longitude, latitude = coordinate_transform(frame, LONLAT)(middle[:, 0], middle[:, 1])
    if _lies_in_area_of_use(frame, longitude, latitude - SITES.max_origin_error_deg):
        return ()
    return (
        f"coordinates of the buildings (as in {middle[0, 0]:.0f}, {middle[0, 1]:.0f}) look local: near the origin of "
        f"{frame.to_string()}, outside its area; give their offset (buildings.offset) for a place on the Earth",
    )


def _lies_in_area_of_use(frame: CRS, longitude: Float64Array, latitude: Float64Array) -> bool:
    """Return True where all places, degrees, are in the area of use of a CRS that has one."""
    return frame.area_of_use is not None and bool(_area_of_use_mask(frame, longitude, latitude, 0.0).all())


def _area_of_use_mask(frame: CRS, longitude: Float64Array, latitude: Float64Array, margin: float) -> BoolArray:
    """Return a mask (n,) of places, degrees, in the area of use of a CRS with a margin; of all where it has none."""
    area = frame.area_of_use
    if area is None:
        return np.ones(len(longitude), bool)
    east = (longitude - area.west + margin) % 360.0
    width = (area.east - area.west) % 360.0 + 2 * margin + (360.0 if area.west <= -180.0 else 0.0)
    found: BoolArray = (latitude >= area.south - margin) & (latitude <= area.north + margin) & (east <= width)
    return found


def swapped_places(first: Float64Array, second: Float64Array) -> bool:
    """Return True where two boxes (west, south, east, north), degrees, meet once the axes of one are swapped."""
    west, south, east, north = second[[1, 0, 3, 2]] + np.array([-1, -1, 1, 1]) * SITES.max_swapped_gap_deg
    return bool(first[0] <= east and first[2] >= west and first[1] <= north and first[3] >= south)


def _is_in_use(frame: CRS, points: Float64Array) -> BoolArray:
    """Return a mask (n,) of points that lie on Earth, and in the area of use of a CRS that has one."""
    longitude, latitude = coordinate_transform(frame, LONLAT)(points[:, 0], points[:, 1])
    with np.errstate(invalid="ignore"):
        found: BoolArray = np.isfinite(longitude + latitude) & (np.abs(longitude) <= 360.0) & (np.abs(latitude) <= 90.0)
        found &= _area_of_use_mask(frame, longitude, latitude, SITES.area_margin_deg)
    if not frame.is_geographic:  # beyond its zone a projection may fold back
        x, y = coordinate_transform(LONLAT, frame)(longitude, latitude)
        with np.errstate(invalid="ignore"):
            found &= np.hypot(x - points[:, 0], y - points[:, 1]) < 1.0
    return found


def reject_metres(option: str, values: Sequence[float], find_frame: Callable[[], CRS | None] = lambda: None) -> None:
    """Raise InputError where the x and y of places cannot be degrees; it has the same places in degrees if they are known.

    Parameters
    ----------
    option : option of the command line, for the message.
    values : x and y of places, one after the other.
    find_frame : returns the frame of the data, in which they may be meant.
    """
    sizes = np.abs(values)
    if sizes.max() <= 180.0 and sizes.min() <= 90.0:
        return
    message = f"{option}: {format_numbers(values)}; longitude and latitude in degrees are needed"
    frame = find_frame() if sizes.min() > 360.0 else None  # else a slip in degrees
    if frame is not None and frame.is_projected:
        x, y = np.reshape(np.asarray(values, dtype=float), (-1, 2)).T
        places = np.column_stack(coordinate_transform(frame, LONLAT)(x, y))
        if np.isfinite(places).all() and not note_outside_area_of_use(frame, *places.mean(axis=0).tolist()):
            degrees = format_numbers(places.round(5).ravel().tolist())
            raise InputError(f"{message}: write {option} {degrees} (from {frame.to_string()})")
    raise InputError(message)


def format_numbers(values: Sequence[float]) -> str:
    """Return numbers as they are typed after an option."""
    return " ".join(f"{value:.12g}" for value in values)
