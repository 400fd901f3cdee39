"""Appearance cost of relabelling element types, from projected patches."""

from __future__ import annotations

import numpy as np

from facade_core.core.arrays import Float32Array, Float64Array
from facade_core.core.fixed_order import principal_coordinates

# Number of principal components (d in the paper).
PRINCIPAL_COMPONENTS = 7


def project_on_principal_components(patches: Float32Array) -> Float64Array:
    """Project patches on their principal components.

    Parameters
    ----------
    patches : (N, h, w, 3).

    Returns
    -------
    (N, d) coordinates in intensities, d at most PRINCIPAL_COMPONENTS.
    """
    return principal_coordinates(patches.reshape(len(patches), -1).astype(np.float64), PRINCIPAL_COMPONENTS)


def relabelling_cost(representatives: Float64Array) -> Float64Array:
    """Return the (T, T) cost C of relabelling: cubed SSD between representatives, normalised to 1.

    Parameters
    ----------
    representatives : (T, d) projected representative of each type.
    """
    ssd = np.array([((representatives - row) ** 2).sum(axis=1) for row in representatives])
    ssd = ssd.reshape(len(representatives), len(representatives))
    cost: Float64Array = (ssd / max(ssd.max(initial=0), 1e-12)) ** 3
    return cost
