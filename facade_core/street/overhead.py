"""What is under the free sky: all that a picture from straight above can show."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.raycast import RayCaster

# Rays start this far above a place: its surface's triangles may lie centimetres off its plane.
LIFT_M = 0.1


def free_above(caster: RayCaster, points: np.ndarray) -> np.ndarray:
    """Whether nothing of the block lies above each world point (n, 3): (n,) bool."""
    if len(points) == 0:
        return np.zeros(0, bool)
    up = np.array([0.0, 0.0, 1.0])
    return ~np.isfinite(caster.cast(points + LIFT_M * up, np.broadcast_to(up, points.shape))[0])
