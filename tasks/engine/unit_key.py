"""Keys of units: one digest per kind of input.

A key is text ("code:0f3a... photo:77b1..."), so that two keys of a unit show why it is pending.
"""

from __future__ import annotations

from facade_core.atlas.journal import unit_key


def join_key_parts(code: str, **parts: object) -> str:
    """Return the key of a unit from its stage's code and its inputs by kind (strings, numbers, nested lists and dicts)."""
    return " ".join([f"code:{code}", *(f"{kind}:{unit_key(value)[:16]}" for kind, value in parts.items())])


def split_key(key: str) -> dict[str, str]:
    """Return the digests of a key by kind of input: "code" first."""
    return dict(part.partition(":")[::2] for part in key.split())


def diff_key_parts(recorded: str, key: str) -> list[str]:
    """Return the kinds of input in which two keys of a unit differ."""
    before, now = split_key(recorded), split_key(key)
    return sorted(kind for kind in before | now if before.get(kind) != now.get(kind))
