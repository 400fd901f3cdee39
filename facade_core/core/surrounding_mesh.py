"""Mesh of what stands and lies around a block, in plain colours of its materials."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from facade_core.core.arrays import Float64Array, Int32Array, Int64Array, UInt8Array
from facade_core.core.types import SURFACES

# Materials 0 to len(SURFACES) - 1 are the surfaces of the ground.


class SurroundingMaterial(IntEnum):
    """Material of surroundings that is no surface of SURFACES."""

    WALL = len(SURFACES)
    ROOF = len(SURFACES) + 1
    WINDOW = len(SURFACES) + 2


@dataclass(frozen=True, eq=False)
class SurroundingMesh:
    """Buildings and ground around a block; vertices of different planes or materials are different ones.

    Attributes
    ----------
    vertices : (v, 3) world metres.
    normal : (v, 3) outward unit vectors.
    material : (v,) index of SURFACES, or a SurroundingMaterial.
    tint : (v, 3) stated colour, 0 to 255; all zeros where none is stated. The colour of windows.
    seed : (v,) number of the building, for colours that are not stated.
    triangles : (t, 3) vertex indices, counter-clockwise as seen from outside.
    """

    vertices: Float64Array
    normal: Float64Array
    material: UInt8Array
    tint: UInt8Array
    seed: Int64Array
    triangles: Int32Array

    def __len__(self) -> int:
        return len(self.triangles)


NO_SURROUNDINGS = SurroundingMesh(
    np.zeros((0, 3)),
    np.zeros((0, 3)),
    np.zeros(0, np.uint8),
    np.zeros((0, 3), np.uint8),
    np.zeros(0, np.int64),
    np.zeros((0, 3), np.int32),
)
