"""Comparison of the keys of units."""

from tasks.engine.inputs import split_key


def differing_inputs(recorded: str, key: str) -> list[str]:
    """Return the names of the inputs in which two keys differ."""
    before, now = split_key(recorded), split_key(key)
    return sorted(name for name in before | now if before.get(name) != now.get(name))
