"""Hashes of names."""

from __future__ import annotations

from hashlib import blake2b


def hash_name(name: str) -> int:
    """Return a 32-bit hash of a name, for use as a random seed."""
    return int.from_bytes(blake2b(name.encode(), digest_size=4).digest())
