"""Numbers for names."""

from __future__ import annotations

from hashlib import blake2b


def number_of(name: str) -> int:
    """A number of 32 bits for a name, that chance may be seeded by."""
    return int.from_bytes(blake2b(name.encode(), digest_size=4).digest())
