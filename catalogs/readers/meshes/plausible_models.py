"""Models of mesh files that are no buildings, or of another unit than metres."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pyproj import CRS

from catalogs.features import BuildingModel, Remark
from catalogs.readers.meshes.surfaces import MeshSurface
from catalogs.readers.settings import MODELS
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError

# Names of objects that programs export along with buildings.
_OTHER_OBJECT = re.compile(
    r"(?:terrain|dem|dtm|topograph\w*|ground[\W_]*plane|landscape|gel(?:ä|ae)nde|relief|roads?|streets?|trees?|vegetation|water"
    r"|forest|.*\bosm_(?:roads?|paths?|water|forest|vegetation|railways?)\w*)[\W_\d]*",
    re.IGNORECASE,
)
_EARTH_RADII_M = (6_340_000.0, 6_390_000.0)
FLAT_REASON = "models without height (ground, streets, water) set aside"
OTHER_OBJECT_REASON = "models named as terrain, streets or trees set aside; rename those that are buildings"


def check_earth_centred(surfaces: Sequence[MeshSurface], path: Path) -> None:
    """Raise InputError where coordinates count from the centre of the Earth, as those of 3D Tiles do."""
    filled = [np.median(one.corners.reshape(-1, 3), axis=0) for one in surfaces if len(one.corners)]
    middles = np.array(filled, np.float64).reshape(-1, 3)
    distance = np.linalg.norm(middles, axis=1)
    low, high = _EARTH_RADII_M
    # northings of a map may be as long, but heights are not
    is_deep = np.abs(middles[:, 2]) > MODELS.max_map_height_m
    if len(middles) and bool((is_deep & (distance > low) & (distance < high)).all()):
        raise InputError(
            f"{path} counts from the centre of the Earth (ECEF), as 3D Tiles do; export it in a projected frame in metres"
        )


def select_plausible_models(
    models: Sequence[BuildingModel], path: Path, frame: CRS | None
) -> tuple[tuple[BuildingModel, ...], list[Remark]]:
    """Return the models that may be buildings, and remarks on the others.

    Parameters
    ----------
    models : models of the file.
    path : file.
    frame : frame of x and y, None where it is unknown.

    Raises
    ------
    InputError
        Where the models are of a size that another unit than metres explains, or none has a height.
    """
    kept, remarks, sizes = [], [], []
    for model in models:
        size = np.ptp(model.shell.vertices, axis=0)
        is_flat = size[2] < MODELS.min_building_height_m and size.max() >= MODELS.min_largest_model_m
        if is_flat or _OTHER_OBJECT.fullmatch(model.id):
            remarks.append(Remark(model.id, FLAT_REASON if is_flat else OTHER_OBJECT_REASON, None))
        else:
            kept.append(model)
            sizes.append(size)
    if models and not kept:
        raise InputError(f"{path} holds flat models or terrain only; give one with buildings (of y-up files: up: y)")
    if kept:
        _check_unit(np.array(sizes), path, frame)
    return tuple(kept), remarks


def _check_unit(sizes: Float64Array, path: Path, frame: CRS | None) -> None:
    """Raise InputError where models of sizes (n, 3) are of another unit than metres."""
    if frame is not None and frame.is_geographic:
        return
    height, longest = float(np.median(sizes[:, 2])), float(sizes.max())
    if height > MODELS.max_median_height_m or longest < MODELS.min_largest_model_m:
        raise InputError(
            f"{path}: its models are {height:.3g} m high (median) and up to {longest:.3g} m long, as in another unit; "
            "export it in metres"
        )
