"""Views added one by one, as the kernel of streets adds them."""

from __future__ import annotations

import numpy as np

from facade_core.core.numba_cache import njit
from facade_core.street.propagation.blend import BlendState, add_view


@njit(cache=True)
def add_views(
    state: BlendState, texel: np.ndarray, d: np.ndarray, proper: np.ndarray, view: np.ndarray, rgb: np.ndarray
) -> None:
    """Add n views of texels (n,), at d millimetres (n,), within the gate (n,), by viewpoint (n,), of colours (n, 3)."""
    for i in range(len(texel)):
        add_view(state, texel[i], d[i], proper[i], view[i], rgb[i])
