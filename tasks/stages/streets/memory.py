"""Memory of a street."""

from __future__ import annotations

from facade_core.street.translator.neural_translator import MAX_NETWORK_PIXELS
from tasks.stages.shared.memory import LIBRARY_BYTES

# Bytes per pixel that the neural translator works on (measured: 1700 to 1900).
NETWORK_PIXEL = 2000
# Bytes per texel of a street's buffer that is read: base layer, colour and provenance.
READ_TEXEL = 16
# Bytes per texel that a street writes: blend state too (measured: 61 to 64 in all).
WRITTEN_TEXEL = 64


def street_memory(read: int, written: int, *, network: int = 0) -> int:
    """Return the memory of a street.

    Parameters
    ----------
    read : texels that it sees.
    written : texels that it writes.
    network : pixels of a panorama for the network.
    """
    return (
        LIBRARY_BYTES + read * READ_TEXEL + written * WRITTEN_TEXEL + min(network, MAX_NETWORK_PIXELS) * NETWORK_PIXEL
    )
