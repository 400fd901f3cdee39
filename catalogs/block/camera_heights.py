"""Heights of cameras whose datum is not that of the ground: above the sea, the ellipsoid or the ground itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from catalogs.features import format_reason_notes
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.arrays import BoolArray, Float64Array
from facade_core.core.types import Building, ElevationRaster

# Heights above the ground of a camera in a hand, on a tripod, a car or a mast, metres.
CAMERA_HEIGHT_RANGE_M = (0.5, 8.0)
# Buildings whose bases tell the ground at a camera.
NEIGHBOURS = 5


@dataclass(frozen=True)
class GroundHeights:
    """Heights of the ground that the sources of a block state.

    Attributes
    ----------
    terrain : raster of heights, None without one.
    places, heights : (n, 2) and (n,) of the bases of buildings, metres.
    """

    terrain: ElevationRaster | None
    places: Float64Array
    heights: Float64Array

    @property
    def is_stated(self) -> bool:
        """Return True where any source states a height of the ground."""
        return self.terrain is not None or len(self.heights) > 0

    def at(self, points: Float64Array) -> Float64Array:
        """Return the ground heights (n,) at points (n, 2), metres; NaN where the terrain is unknown."""
        if self.terrain is not None:
            raster = self.terrain
            rows = np.rint((raster.y - points[:, 1]) / raster.step).astype(np.int64)
            columns = np.rint((points[:, 0] - raster.x) / raster.step).astype(np.int64)
            high, wide = raster.heights.shape
            found = raster.heights[np.clip(rows, 0, high - 1), np.clip(columns, 0, wide - 1)].astype(np.float64)
            return np.where(np.isfinite(found), found, self._at_buildings(points)) if len(self.heights) else found
        return self._at_buildings(points) if len(self.heights) else np.zeros(len(points))

    def _at_buildings(self, points: Float64Array) -> Float64Array:
        """Return the median ground height (n,) of the buildings nearest to points (n, 2)."""
        from scipy.spatial import cKDTree

        nearest = cKDTree(self.places).query(points, k=min(NEIGHBOURS, len(self.heights)))[1]
        return np.asarray(np.median(self.heights[nearest].reshape(len(points), -1), axis=1), np.float64)


def ground_heights(buildings: Sequence[Building], terrain: ElevationRaster | None) -> GroundHeights:
    """Return the ground heights of a block: of its terrain, else of the bases and models of its buildings."""
    known = [(building, z) for building in buildings if (z := _base_height(building)) is not None]
    centres = shapely.get_coordinates(shapely.centroid([building.footprint for building, _ in known]))
    return GroundHeights(terrain, centres.reshape(-1, 2), np.array([z for _, z in known], np.float64))


def correct_camera_heights(
    panoramas: Sequence[PosedPanorama], ground: GroundHeights, camera_height: float
) -> tuple[tuple[PosedPanorama, ...], tuple[str, ...]]:
    """Correct the stated heights of cameras that are of another datum than the ground.

    A height is plausible within CAMERA_HEIGHT_RANGE_M above the ground. If most heights are not, they are shifted by one
    offset, which puts the median camera at `camera_height`; heights that are plausible by themselves are taken as heights
    above the ground. Other implausible heights become unknown. So do all where no source states the ground: their
    differences would follow a relief that the flat ground does not have.

    Parameters
    ----------
    panoramas : panoramas of the block.
    ground : heights of its ground.
    camera_height : usual height of a camera above the ground, metres.

    Returns
    -------
    The panoramas, and a note on each correction.
    """
    stated = [index for index, one in enumerate(panoramas) if one.pose.z is not None]
    if not stated:
        return tuple(panoramas), ()
    z = np.array([panoramas[index].pose.z for index in stated], np.float64)
    level = ground.at(np.array([(panoramas[index].pose.x, panoramas[index].pose.y) for index in stated]))
    unknown = ~np.isfinite(level)
    if unknown.all():
        reason = "camera heights over ground without a known height ignored; extend the terrain, or leave z out"
        return _with_heights(panoramas, stated, np.full(len(z), np.nan), unknown, reason)
    level[unknown] = np.median(level[~unknown])
    above = z - level
    wrong = ~_is_plausible(above)
    if not wrong.any():
        return tuple(panoramas), ()
    if not ground.is_stated:
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


def _base_height(building: Building) -> float | None:
    if building.base is not None:
        return building.base
    if building.shell is not None and len(building.shell.triangles):
        return float(building.shell.vertices[building.shell.triangles, 2].min())
    return None


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
