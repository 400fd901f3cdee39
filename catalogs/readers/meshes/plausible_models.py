"""Models of mesh files that are no buildings, or of another unit than metres."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catalogs.features import BuildingModel, Remark
from catalogs.readers.meshes.surfaces import MeshSurface
from facade_core.core.arrays import Float64Array
from facade_core.core.errors import InputError

_MIN_HEIGHT_M = 0.3  # m; models below it are ground, streets and water
# Names of objects that programs export along with buildings.
_OTHER_OBJECT = re.compile(
    r"(?:terrain|dem|dtm|topograph\w*|ground[\W_]*plane|landscape|gel(?:ä|ae)nde|relief|roads?|streets?|trees?|vegetation|water"
    r"|forest|.*\bosm_(?:roads?|paths?|water|forest|vegetation|railways?)\w*)[\W_\d]*",
    re.IGNORECASE,
)
# Medians of all models, metres: beyond them no street of buildings is.
_MAX_MEDIAN_HEIGHT_M = 400.0
_MAX_MEDIAN_LENGTH_M = 200.0
_MIN_LENGTH_M = 1.0
_EARTH_RADII_M = (6_340_000.0, 6_390_000.0)
_MAX_HEIGHT_M = 20_000.0  # m; of z in a frame of a map
_MIN_ROUNDING_M = 0.1  # m; smaller steps show in no picture
_MAX_SINGLE = 1e30
FLAT_REASON = "models without height (ground, streets, water) set aside"
OTHER_OBJECT_REASON = "models named as terrain, streets or trees set aside; rename those that are buildings"


def note_rounded_coordinates(surfaces: Sequence[MeshSurface], name: str, metres_per_unit: float = 1.0) -> list[Remark]:
    """Return a remark where large coordinates were rounded to numbers of single precision.

    Parameters
    ----------
    surfaces : surfaces of the file, as stored.
    name : name of the file.
    metres_per_unit : unit of the coordinates.
    """
    points = [one.corners.reshape(-1, 3) for one in surfaces if len(one.corners)]
    largest = np.max([np.zeros(3), *(np.nan_to_num(np.abs(one)).max(axis=0) for one in points)], axis=0)
    step = float(np.spacing(np.minimum(largest, _MAX_SINGLE).astype(np.float32)).max())
    # coordinates of the other axes show that the numbers are not whole by choice
    metres = step * metres_per_unit
    with np.errstate(over="ignore"):  # larger numbers are no single precision either
        is_single = all((one.astype(np.float32) == one).all() for one in points)
    if metres < _MIN_ROUNDING_M or not is_single:
        return []
    if not any((one % step != 0).any() for one in points):
        return []
    reason = f"mesh files whose large coordinates are rounded to {metres:g} m, as single precision does; export the model near"
    return [Remark(name, f"{reason} its origin, and give buildings.offset", None)]


def check_earth_centred(surfaces: Sequence[MeshSurface], path: Path) -> None:
    """Raise InputError where coordinates count from the centre of the Earth, as those of 3D Tiles do."""
    filled = [np.median(one.corners.reshape(-1, 3), axis=0) for one in surfaces if len(one.corners)]
    middles = np.array(filled, np.float64).reshape(-1, 3)
    distance = np.linalg.norm(middles, axis=1)
    low, high = _EARTH_RADII_M
    # northings of a map may be as long, but heights are not
    is_deep = np.abs(middles[:, 2]) > _MAX_HEIGHT_M
    if len(middles) and bool((is_deep & (distance > low) & (distance < high)).all()):
        raise InputError(
            f"{path} counts from the centre of the Earth (ECEF), as 3D Tiles do; export it in a projected frame in metres"
        )


def select_plausible_models(
    models: Sequence[BuildingModel], path: Path, *, is_metric: bool
) -> tuple[tuple[BuildingModel, ...], list[Remark]]:
    """Return the models that may be buildings, and remarks on the others.

    Parameters
    ----------
    models : models of the file.
    path : file.
    is_metric : False where x and y are degrees.

    Raises
    ------
    InputError
        Where the models are of a size that another unit than metres explains, or none has a height.
    """
    kept, remarks, sizes = [], [], []
    for model in models:
        size = np.ptp(model.shell.vertices, axis=0)
        is_flat = size[2] < _MIN_HEIGHT_M and size.max() >= _MIN_LENGTH_M
        if is_flat or _OTHER_OBJECT.fullmatch(model.id):
            remarks.append(Remark(model.id, FLAT_REASON if is_flat else OTHER_OBJECT_REASON, None))
        else:
            kept.append(model)
            sizes.append(size)
    if models and not kept:
        raise InputError(f"{path} holds flat models or terrain only; give one with buildings (of y-up files: up: y)")
    if kept and is_metric:
        _check_unit(np.array(sizes), path)
    return tuple(kept), remarks


def _check_unit(sizes: Float64Array, path: Path) -> None:
    """Raise InputError where models of sizes (n, 3) are of another unit than metres."""
    length, height = float(np.median(sizes[:, :2].max(axis=1))), float(np.median(sizes[:, 2]))
    if height > _MAX_MEDIAN_HEIGHT_M and length > _MAX_MEDIAN_LENGTH_M:
        unit = "millimetres" if height > 10 * _MAX_MEDIAN_HEIGHT_M else "centimetres or inches"
        raise InputError(
            f"{path}: its models are {length:.0f} m long and {height:.0f} m high, as in {unit}; export it in metres"
        )
    if sizes.max() < _MIN_LENGTH_M:
        raise InputError(
            f"{path}: its largest model is {sizes.max():.3g} m long, as in kilometres or another unit; export it in metres"
        )
