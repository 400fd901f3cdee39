"""Wavefront OBJ of textured nodes, with a material library of one material for each texture page."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from facade_core.export.models.glb import GltfNode

_SPACES = re.compile(r"\s+")


def format_obj(nodes: Iterable[GltfNode], material_library: str, comments: Sequence[str]) -> Iterator[str]:
    """Yield the text of an OBJ file, with an object for each node.

    Parameters
    ----------
    nodes : named nodes; their materials are pages.
    material_library : file of the material library, beside the OBJ file.
    comments : lines for the head of the file.
    """
    yield "".join(f"# {_SPACES.sub(' ', line)}\n" for line in comments) + f"mtllib {material_library}\n"
    first = 1
    for node in nodes:
        yield f"o {_object_name(node.name)}\n"
        for primitive in node.primitives:
            up = np.column_stack([primitive.uv[:, 0], 1 - primitive.uv[:, 1]])
            yield _rows("v %.3f %.3f %.3f\n", primitive.position)
            yield _rows("vt %.6f %.6f\n", up)
            yield _rows("vn %.4f %.4f %.4f\n", primitive.normal)
            yield f"usemtl {_material_name(primitive.material)}\n"
            yield _rows("f %d/%d/%d %d/%d/%d %d/%d/%d\n", np.repeat(primitive.triangles + first, 3, axis=1))
            first += len(primitive.position)


def format_materials(textures: Sequence[str]) -> str:
    """Return the text of a material library: an unlit material for each texture file."""
    return "".join(
        f"newmtl {_material_name(page)}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {texture}\n"
        for page, texture in enumerate(textures)
    )


def _rows(pattern: str, values: np.ndarray) -> str:
    return "".join(pattern % tuple(row) for row in values.tolist())


def _object_name(name: str) -> str:
    """Return a name without white space, which would end it."""
    return _SPACES.sub("_", name) or "_"


def _material_name(page: int) -> str:
    return f"page-{page:04}"
