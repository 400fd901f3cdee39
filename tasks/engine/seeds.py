"""Random seeds of units."""

from __future__ import annotations

from tasks.engine.run import Run

# Names of random sequences: part of each seed, so a change changes every texture.
EXEMPLAR_SEED = "exemplar"
FACADE_SEED = "facade"
BUILDING_SEED = "house"


def unit_seed(run: Run, unit: str, sequence: str) -> int:
    """Return the seed of a random sequence of a unit, by the block's seed, the unit's id and the sequence's name."""
    import hashlib

    text = f"{run.seed}/{unit}/{sequence}"
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=4).digest(), "big")
