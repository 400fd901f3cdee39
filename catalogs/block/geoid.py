"""Height of the geoid above the ellipsoid, by the EGM96 model on a grid of a quarter of a degree."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from catalogs.buildings.extents import Bounds
from catalogs.crs import middle_to_lonlat

GRID_FILE = Path(__file__).with_name("egm96.npz")


def geoid_height(longitude: float, latitude: float) -> float:
    """Return the height of the EGM96 geoid above the WGS 84 ellipsoid in metres, to the centimetre.

    Parameters
    ----------
    longitude, latitude : degrees, from -180 to 180 and from -90 to 90.

    References
    ----------
    Lemoine et al., The Development of the Joint NASA GSFC and NIMA Geopotential Model EGM96, NASA/TP-1998-206861.
    """
    from scipy.interpolate import RegularGridInterpolator

    with np.load(GRID_FILE, allow_pickle=False) as file:
        centimetres = np.cumsum(file["column_steps"].astype(np.int32), axis=1)
    rows, columns = centimetres.shape
    latitudes, longitudes = np.linspace(-90.0, 90.0, rows), np.linspace(-180.0, 180.0, columns)
    found = RegularGridInterpolator((latitudes, longitudes), centimetres / 100.0)([[latitude, longitude]])
    return round(float(found[0]), 2)


def resolve_geoid_separation(
    stated: float | str | None, crs: str, extent: Bounds
) -> tuple[float | None, tuple[str, ...]]:
    """Return the geoid separation of a block in metres, and a note where it is that of the model in its middle.

    Parameters
    ----------
    stated : metres, "auto" or None.
    crs : metric frame of the block.
    extent : (xmin, ymin, xmax, ymax) in it.
    """
    if not isinstance(stated, str):
        return stated, ()
    height = geoid_height(*middle_to_lonlat(crs, extent))
    return height, (f"geoid_separation: {height:.2f} m, that of EGM96 (to about 1 m) in the middle of the block",)
