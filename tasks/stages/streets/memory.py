"""Memory of a street."""

from __future__ import annotations

from tasks.stages.shared.memory import LIBRARY_BYTES

# Bytes of the translation network, and for each pixel of the panorama that it paints and translates.
NETWORK_BYTES = 400_000_000
NETWORK_PIXEL = 160
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
    network : pixels of a panorama for the neural translator; 0 without it.
    """
    translator = NETWORK_BYTES + network * NETWORK_PIXEL if network else 0
    return LIBRARY_BYTES + read * READ_TEXEL + written * WRITTEN_TEXEL + translator
