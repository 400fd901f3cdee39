"""Building models of mesh files: OBJ, glTF, PLY, STL and arrays of triangles (.npz)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from pyproj import CRS

from catalogs.crs import parse_crs
from catalogs.features import BuildingModels, Remark, select_textures
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.meshes.gltf import read_gltf_surfaces
from catalogs.readers.meshes.header_comments import read_header_comments
from catalogs.readers.meshes.npz import check_npz_arrays
from catalogs.readers.meshes.obj import read_obj_surfaces
from catalogs.readers.meshes.plain import read_plain_mesh
from catalogs.readers.meshes.plausible_models import (
    check_earth_centred,
    select_plausible_models,
)
from catalogs.readers.meshes.surface_names import merge_surface_names
from catalogs.readers.meshes.surfaces import MeshContent, MeshSurface, group_into_models
from catalogs.readers.meshes.up_axis import turn_up
from catalogs.readers.settings import LIMITS
from catalogs.readers.source_keys import NO_SOURCE_KEYS, UP_AXIS_SUFFIXES, SourceKeys
from facade_core.core.errors import InputError


def read_mesh_buildings(path: Path, lod: str | None = None, keys: SourceKeys = NO_SOURCE_KEYS) -> BuildingModels:
    """Read the buildings of a mesh file, in the coordinates of the file in metres, z up.

    Each named group, object or node is one model. Its name up to a | is the id of the building; the name behind it, or that of
    the material, gives the semantic. Without several names each connected component is one model, -0, -1, ... from west to
    east; components above one another are merged. glTF is converted to z up; OBJ, PLY and STL are where `keys.up` says so, or
    their faces show it.

    Parameters
    ----------
    path : .obj, .glb, .gltf, .ply, .stl or .npz file.
    lod : ignored, since mesh files have no level of detail.
    keys : what the block file states of the file; `up` is used.

    Raises
    ------
    InputError
        Where the file cannot be read or holds no triangle.
    """
    kind = path.suffix.lower()
    readers = {".npz": _read_npz, ".obj": read_obj_surfaces, ".glb": read_gltf_surfaces, ".gltf": read_gltf_surfaces}
    surfaces, textures, found, faults, crs = readers.get(kind, read_plain_mesh)(path)
    remarks = list(found)
    stated = keys.crs or crs
    frame = None if stated is None else parse_crs(stated)
    if kind in UP_AXIS_SUFFIXES:
        surfaces, placed = _place_by_comments(path, surfaces, keys, frame)
        remarks += placed
    if not any(len(surface.corners) for surface in surfaces) and not faults:
        raise InputError(f"{path} holds no triangles; export the buildings as a mesh")
    check_earth_centred(surfaces, path)
    models, broken = group_into_models(merge_surface_names(surfaces), path.stem, remarks)
    models, others = select_plausible_models(models, path, frame)
    kept, textures = select_textures(models, textures)
    return BuildingModels(crs, tuple(kept), textures, (*remarks, *others), (*faults, *broken))


def _place_by_comments(
    path: Path, surfaces: list[MeshSurface], keys: SourceKeys, frame: CRS | None
) -> tuple[list[MeshSurface], list[Remark]]:
    """Return the surfaces in metres and with z up, as the comments of the file or its faces show, and the remarks."""
    stated_up, unit = read_header_comments(path)
    remarks = []
    if unit not in (None, 1.0) and (frame is None or frame.axis_info[0].unit_conversion_factor == 1.0):
        surfaces = [replace(one, corners=one.corners * unit) for one in surfaces]
        remarks.append(Remark(path.name, f"mesh files whose comments state units of {unit} m, converted", None))
    surfaces, turned = turn_up(surfaces, keys.up, path.name, stated_up)
    return surfaces, remarks + turned


def _read_npz(path: Path) -> MeshContent:
    """Read triangles (n, 3, 3), feature (n,) as the number of the building, and optional origin (3,) and epsg ()."""
    wanted = "triangles (n, 3, 3), feature (n,) of integers and, if needed, origin (3,) and epsg"
    names = ("triangles", "feature", "origin", "epsg")
    check_npz_arrays(path, names)
    with wrap_reader_errors(path, "cannot be read as arrays of triangles", f"give {wanted}"):
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in names if name in file}
        triangles = np.asarray(arrays["triangles"])
        feature = np.asarray(arrays["feature"])
        origin = np.asarray(arrays.get("origin", np.zeros(3)), np.float64)
        crs = f"EPSG:{int(arrays['epsg'])}" if "epsg" in arrays else None
    if triangles.size > 9 * LIMITS.max_triangles:
        raise InputError(f"{path} holds over {LIMITS.max_triangles} triangles; cut out the block that is meant")
    fits = (feature.ndim, triangles.shape, origin.shape) == (1, (*feature.shape, 3, 3), (3,))
    if not fits or triangles.dtype.kind not in "fiu" or feature.dtype.kind not in "iu":
        raise InputError(
            f"{path}: triangles {triangles.shape}, feature {feature.shape}, {feature.dtype}; give {wanted}"
        )
    numbers, counts = np.unique(feature, return_counts=True)
    parts = np.split(np.argsort(feature, kind="stable"), np.cumsum(counts)[:-1])
    surfaces = [
        MeshSurface(str(number), "unknown", np.asarray(triangles[part], np.float64) + origin)
        for number, part in zip(numbers, parts, strict=False)
    ]
    return MeshContent(surfaces, crs=crs)
