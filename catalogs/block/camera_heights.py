"""Heights of cameras whose datum is not that of the ground: above the sea, the ellipsoid or the ground itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from catalogs.features import format_reason_notes
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.types import Building, ElevationRaster
from facade_core.geometry.ground.terrain import Terrain, build_terrain, source_ground_height

# Heights above the ground of a camera in a hand, on a tripod, a car or a mast, metres.
CAMERA_HEIGHT_RANGE_M = (0.5, 8.0)
# Heights of most cameras, metres. A median outside is more often one of another datum.
USUAL_HEIGHT_RANGE_M = (1.0, 5.0)
# Metres between two readings of the heights from which a note says which one counts.
MIN_DOUBT_M = 0.5

_UNKNOWN_GROUND = "whose height no source states; give terrain: {path: ...}, or leave z out"


def correct_camera_heights(
    panoramas: Sequence[PosedPanorama],
    buildings: Sequence[Building],
    elevation: ElevationRaster | None,
    camera_height: float,
) -> tuple[tuple[PosedPanorama, ...], tuple[str, ...]]:
    """Correct the stated heights of cameras that are of another datum than the ground.

    A height is plausible within CAMERA_HEIGHT_RANGE_M above the ground. If most heights are not, they are shifted by one
    offset, which puts the median camera at `camera_height`; heights that are plausible by themselves are taken as heights
    above the ground. Other implausible heights become unknown. A plausible median outside USUAL_HEIGHT_RANGE_M is kept with a
    note, unless the stated heights are usual above the ground itself: then they are taken so. Where no source states the
    ground, all heights become unknown if one is implausible or their median unusual: their differences would follow a relief
    that the flat ground does not have.

    Parameters
    ----------
    panoramas : panoramas, or pictures of lenses, of the block; those that look down keep their heights, with a note.
    buildings : its buildings, whose bases are the ground without a raster.
    elevation : raster of its ground, None without one.
    camera_height : usual height of a camera above the ground, metres.

    Returns
    -------
    The panoramas, and a note on each correction.
    """
    from_above = [one for one in panoramas if one.pose.is_aerial and one.pose.z is not None]
    if from_above:
        others = [one for one in panoramas if one not in from_above]
        corrected, notes = correct_camera_heights(others, buildings, elevation, camera_height)
        corrected_by_id = {one.id: one for one in corrected}
        note = _describe_aerial(_heights_above_ground(from_above, build_terrain(buildings, elevation)))
        return tuple(corrected_by_id.get(one.id, one) for one in panoramas), (*notes, note)
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
    is_usual = _is_usual(above)
    every, unknown = np.ones(len(z), bool), np.full(len(z), np.nan)
    if not _is_ground_stated(buildings, elevation):
        if is_usual and not wrong.any():
            return tuple(panoramas), ()
        return _with_heights(panoramas, stated, unknown, every, _ignored(above, _UNKNOWN_GROUND))
    is_above_ground = not is_usual and _is_usual(z)
    if 2 * wrong.sum() <= len(z) and not is_above_ground:
        doubt = _describe_doubt(above, z, camera_height, has_raster=elevation is not None)
        kept, notes = _with_heights(panoramas, stated, z, every & ~wrong & bool(doubt), doubt)
        found, more = _with_heights(kept, stated, unknown, wrong, _ignored(above[wrong]))
        return found, notes + more
    if is_above_ground or _is_plausible(z).sum() * 2 > len(z):
        new, how = level + z, "camera heights taken as heights above the ground, not of its datum"
    else:
        offset = float(np.median(above)) - camera_height
        new, how = z - offset, f"camera heights of another datum than the ground, lowered by {offset:.2f} m"
        if offset < 0:
            how = f"camera heights of another datum than the ground, raised by {-offset:.2f} m"
    sound = _is_plausible(new - level)
    if 2 * sound.sum() <= len(z):
        return _with_heights(panoramas, stated, unknown, every, _ignored(above))
    shifted, notes = _with_heights(panoramas, stated, new, sound, how)
    rest, more = _with_heights(shifted, stated, unknown, ~sound, _ignored(above[~sound]))
    return rest, notes + more


def _heights_above_ground(pictures: Sequence[PosedPanorama], terrain: Terrain) -> Float64Array:
    level = terrain.interpolate(np.array([(one.pose.x, one.pose.y) for one in pictures], np.float64))
    return np.array([one.pose.z for one in pictures], np.float64) - level


def _describe_aerial(above: Float64Array) -> str:
    """Return the note on heights of pictures that look down, which no usual camera height can check."""
    low, high = float(above.min()), float(above.max())
    return (
        f"pictures that look down ({len(above)}) kept at their heights, {low:.0f} to {high:.0f} m above the ground; where they "
        "are of another datum than the ground, add the difference"
    )


def _is_ground_stated(buildings: Sequence[Building], elevation: ElevationRaster | None) -> bool:
    if elevation is not None and np.isfinite(elevation.heights).any():
        return True
    return any(source_ground_height(building) is not None for building in buildings)


def _is_plausible(above: Float64Array) -> BoolArray:
    low, high = CAMERA_HEIGHT_RANGE_M
    found: BoolArray = (above >= low - 1e-6) & (above <= high + 1e-6)
    return found


def _is_usual(above: Float64Array) -> bool:
    low, high = USUAL_HEIGHT_RANGE_M
    return low - 1e-6 <= float(np.median(above)) <= high + 1e-6


def _describe_doubt(above: Float64Array, z: Float64Array, camera_height: float, *, has_raster: bool) -> str:
    """Return the note on plausible heights whose datum is in doubt, empty where it is not."""
    median, stated = float(np.median(above)), float(np.median(z))
    low, high = USUAL_HEIGHT_RANGE_M
    if not _is_usual(above):
        sunken = "; if the buildings begin below the ground, give terrain: {path: ...}"
        return (
            f"camera heights kept, {median:.1f} m above the ground (most cameras are {low:g} to {high:g} m); if they are of "
            f"another datum, mend z, or leave it out{'' if has_raster or median < high else sunken}"
        )
    is_nearer = abs(stated - camera_height) < abs(median - camera_height)
    if is_nearer and abs(stated - median) >= MIN_DOUBT_M:
        return (
            f"camera heights read in the datum of the ground, {median:.1f} m above it; if they are heights above the ground "
            "itself, add its height to z"
        )
    return ""


def _ignored(above: Float64Array, remedy: str = "mend z, or leave it out") -> str:
    if not len(above):
        return ""
    low, high = float(np.nanmin(above)), float(np.nanmax(above))
    span = f"{low:.1f} m" if high - low < 0.05 else f"{low:.1f} to {high:.1f} m"
    least, most = CAMERA_HEIGHT_RANGE_M if (~_is_plausible(above)).any() else USUAL_HEIGHT_RANGE_M
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
