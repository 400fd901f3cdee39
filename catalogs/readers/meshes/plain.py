"""Reader of PLY and STL: one mesh without names or pictures, of PLY with colours."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import trimesh
from trimesh import Trimesh
from trimesh.visual import ColorVisuals, TextureVisuals

from catalogs.features import Remark
from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.meshes.surfaces import MeshContent, MeshSurface
from catalogs.readers.settings import MODELS
from facade_core.core.arrays import Float64Array, Int64Array, UInt8Array
from facade_core.core.regular_files import MAX_MODEL_BYTES, read_regular

PICTURE_REASON = "PLY files with a picture (TextureFile): read without it; export the model as OBJ or glTF"
UNREAD_COLOURS_REASON = (
    "PLY files with colours of other names than red, green, blue, or of faces of four corners: read without; "
    "export triangles with colours of vertices"
)
STL_COLOURS_REASON = "STL files with colours of faces: read without; export the model as PLY or glTF"


def read_plain_mesh(path: Path) -> MeshContent:
    """Read PLY or STL: the surfaces by the colour of their faces, and remarks on what is not read.

    The colour of a face is the mean of its corners. White is no colour, since many programs write it everywhere.

    Raises
    ------
    InputError
        Where the file is no mesh.
    """
    with wrap_reader_errors(path, "cannot be read as a mesh", "export it again"):
        # no path, or trimesh opens referenced pictures anywhere
        content, kind = io.BytesIO(read_regular(path, MAX_MODEL_BYTES)), path.suffix.lower()[1:]
        scene = trimesh.load(content, file_type=kind, force="scene", process=False)
        assert isinstance(scene, trimesh.Scene)
    meshes = [mesh for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
    surfaces = [surface for mesh in meshes for surface in _split_by_colour(mesh)]
    reasons = dict.fromkeys(reason for mesh in meshes if (reason := _unread_colours(mesh)))
    return MeshContent(surfaces, remarks=[Remark(path.name, reason, None) for reason in reasons])


def _split_by_colour(mesh: Trimesh) -> list[MeshSurface]:
    corners: Float64Array = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    colours = _face_colours(mesh)
    if colours is None:
        return [MeshSurface(None, "unknown", corners)]
    packed = _pack(colours)
    if len(np.unique(packed)) > MODELS.max_face_colours:
        packed = _pack(colours // MODELS.face_colour_step)
    surfaces = []
    for number in np.unique(packed):
        chosen = packed == number
        red, green, blue = np.rint(colours[chosen].mean(axis=0)).astype(int).tolist()
        colour = None if (red, green, blue) == (255, 255, 255) else (red, green, blue)
        surfaces.append(MeshSurface(None, "unknown", corners[chosen], colour=colour))
    return surfaces


def _face_colours(mesh: Trimesh) -> UInt8Array | None:
    """Return the colours (t, 3) of the triangles; None without, or where they are of other faces."""
    if not isinstance(mesh.visual, ColorVisuals) or not mesh.visual.defined or len(mesh.faces) == 0:
        return None
    colours: UInt8Array = np.asarray(mesh.visual.face_colors, np.uint8)
    return colours[:, :3] if colours.shape == (len(mesh.faces), 4) else None


def _pack(colours: UInt8Array) -> Int64Array:
    packed: Int64Array = colours.astype(np.int64) @ np.array([1 << 16, 1 << 8, 1])
    return packed


def _unread_colours(mesh: Trimesh) -> str | None:
    """Return the reason why colours of a mesh are not read; None where they are, or where it has none."""
    if "stl" in mesh.face_attributes:
        return STL_COLOURS_REASON if np.any(mesh.face_attributes["stl"]) else None
    if isinstance(mesh.visual, TextureVisuals):
        return PICTURE_REASON
    elements = mesh.metadata.get("_ply_raw", {})
    names = {name.lower() for one in ("vertex", "face") for name in elements.get(one, {}).get("properties", ())}
    is_coloured = any("red" in name or name == "r" for name in names)
    return UNREAD_COLOURS_REASON if is_coloured and _face_colours(mesh) is None else None
