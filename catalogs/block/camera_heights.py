"""Heights of cameras whose datum is not that of the ground: above the sea, the ellipsoid or the ground itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catalogs.features import format_reason_notes
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.types import Building, ElevationRaster
from facade_core.geometry.ground.terrain import build_terrain, source_ground_height

# Heights above the ground of a camera in a hand, on a tripod, a car or a mast, metres.
CAMERA_HEIGHT_RANGE_M = (0.5, 8.0)


def correct_camera_heights(
    panoramas: Sequence[PosedPanorama],
    buildings: Sequence[Building],
    elevation: ElevationRaster | None,
    camera_height: float,
) -> tuple[tuple[PosedPanorama, ...], tuple[str, ...]]:
    """Correct the stated heights of cameras that are of another datum than the ground.

    A height is plausible within CAMERA_HEIGHT_RANGE_M above the ground. If most heights are not, they are shifted by one
    offset, which puts the median camera at `camera_height`; heights that are plausible by themselves are taken as heights
    above the ground. Other implausible heights become unknown. So do all where no source states the ground: their
    differences would follow a relief that the flat ground does not have.

    Parameters
    ----------
    panoramas : panoramas of the block.
    buildings : its buildings, whose bases are the ground without a raster.
    elevation : raster of its ground, None without one.
    camera_height : usual height of a camera above the ground, metres.

    Returns
    -------
    The panoramas, and a note on each correction.
    """
    stated = [index for index, one in enumerate(panoramas) if one.pose.z is not None]
    if not stated:
        return tuple(panoramas), ()
    z = np.array([panoramas[index].pose.z for index in stated], np.float64)
    terrain = build_terrain(buildings, elevation)
    level = terrain.interpolate(
        np.array([(panoramas[index].pose.x, panoramas[index].pose.y) for index in stated], np.float64)
    )
    above = z - level
    wrong = ~_is_plausible(above)
    if not wrong.any():
        return tuple(panoramas), ()
    is_stated = elevation is not None and np.isfinite(elevation.heights).any()
    if not is_stated and all(source_ground_height(building) is None for building in buildings):
        every = np.ones(len(z), bool)
        reason = _ignored(above, "whose height no source states; give terrain: {path: ...}, or leave z out")
        return _with_heights(panoramas, stated, np.full(len(z), np.nan), every, reason)
    if 2 * wrong.sum() <= len(z):
        return _with_heights(panoramas, stated, np.where(wrong, np.nan, z), wrong, _ignored(above[wrong]))
    if _is_plausible(z).sum() * 2 > len(z):
        new, how = level + z, "camera heights taken as heights above the ground, not of its datum"
    else:
        offset = float(np.median(above)) - camera_height
        new, how = z - offset, f"camera heights of another datum than the ground, lowered by {offset:.2f} m"
        if offset < 0:
            how = f"camera heights of another datum than the ground, raised by {-offset:.2f} m"
    sound = _is_plausible(new - level)
    if 2 * sound.sum() <= len(z):
        return _with_heights(panoramas, stated, np.full(len(z), np.nan), np.ones(len(z), bool), _ignored(above))
    shifted, notes = _with_heights(panoramas, stated, new, sound, how)
    left = ~sound
    if not left.any():
        return shifted, notes
    rest, more = _with_heights(shifted, stated, np.full(len(z), np.nan), left, _ignored(above[left]))
    return rest, notes + more


def _is_plausible(above: Float64Array) -> BoolArray:
    low, high = CAMERA_HEIGHT_RANGE_M
    found: BoolArray = (above >= low - 1e-6) & (above <= high + 1e-6)
    return found


def _ignored(above: Float64Array, remedy: str = "mend z, or leave it out") -> str:
    low, high = float(np.nanmin(above)), float(np.nanmax(above))
    span = f"{low:.1f} m" if high - low < 0.05 else f"{low:.1f} to {high:.1f} m"
    least, most = CAMERA_HEIGHT_RANGE_M
    return f"camera heights of another datum ignored: {span} above the ground (a camera is {least:g} to {most:g} m), {remedy}"


def _with_heights(
    panoramas: Sequence[PosedPanorama], stated: Sequence[int], z: Float64Array, mask: BoolArray, reason: str
) -> tuple[tuple[PosedPanorama, ...], tuple[str, ...]]:
    """Return the panoramas with the heights of the mask replaced (NaN: unknown), and the note that names them."""
    found = list(panoramas)
    changed = [(index, value) for index, value, put in zip(stated, z.tolist(), mask.tolist(), strict=True) if put]
    for index, value in changed:
        pose = replace(found[index].pose, z=value if np.isfinite(value) else None)
        found[index] = replace(found[index], pose=pose)
    return tuple(found), format_reason_notes({reason: [panoramas[index].id for index, _ in changed]})
