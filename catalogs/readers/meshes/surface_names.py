"""Names of objects that each hold some surfaces of a building, such as "House 1 Walls" and "House 1 Roof"."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from catalogs.readers.meshes.surfaces import SURFACE_WORDS, MeshSurface, semantic_from_names

_NAME_OF_PART = re.compile(
    rf"(?P<building>.+?)[\s_.:-]+(?P<surface>(?:outer)?(?:{SURFACE_WORDS})s?(?:[\W_]*surfaces?)?)(?P<copy>\.\d{{3}})?[\W_\d]*",
    re.IGNORECASE,
)


def merge_surface_names(surfaces: Sequence[MeshSurface]) -> list[MeshSurface]:
    """Return the surfaces with the names of their buildings, where names of buildings end in those of surfaces.

    That is so where at least two kinds of surfaces follow one beginning: a house may be named "Old Wall". The copies
    ".001" of Blender stay apart.
    """
    parts = {one.building: found for one in surfaces if (found := _NAME_OF_PART.fullmatch(one.building or ""))}
    kinds: dict[str, set[str]] = defaultdict(set)
    for found in parts.values():
        kinds[_building(found)].add(semantic_from_names(found["surface"]))
    return [
        replace(
            one,
            building=_building(found),
            semantic=semantic_from_names(found["surface"]) if one.semantic == "unknown" else one.semantic,
        )
        if (found := parts.get(one.building)) and len(kinds[_building(found)]) > 1
        else one
        for one in surfaces
    ]


def _building(found: re.Match[str]) -> str:
    return found["building"] + (found["copy"] or "")
