"""The keys of a city file: those of a block file, and how it is cut; or a folder of block files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from catalogs.block.keys import BlockKeys, check_keys

# A block's side, metres.
SIDE_M, LEAST_M, MOST_M = 400.0, 20.0, 20_000.0
# Keys that only a city has.
CUT, BLOCKS = "cut", "blocks"


def check_city(values: Any) -> tuple[BlockKeys, float] | str:
    """The keys of a city and metres of a block's side, or the folder of its block files.

    Raises ValueError with one line "key: problem; remedy".
    """
    if not isinstance(values, Mapping):
        raise ValueError("holds no keys; write the keys of a block file, or name and blocks: {path: FOLDER}")
    if BLOCKS in values:
        folder = values[BLOCKS]
        if set(values) - {"name", BLOCKS} or not isinstance(folder, Mapping) or set(folder) != {"path"}:
            raise ValueError(
                f"{BLOCKS}: a folder of block files is all that a city has then; write {BLOCKS}: {{path: FOLDER}}"
            )
        if not isinstance(folder["path"], str) or not folder["path"]:
            raise ValueError(f"{BLOCKS}.path: is no folder; write {BLOCKS}: {{path: FOLDER}}")
        return folder["path"]
    rest = {key: value for key, value in values.items() if key != CUT}
    if "part" in rest:
        raise ValueError("part: is a key of the blocks that a city is cut into; leave it out")
    keys = check_keys(rest)
    if keys.streets is None:
        raise ValueError("streets: missing, and a city is cut along its streets; write streets: {path: FILE}")
    side = values.get(CUT, {})
    metres = side.get("metres", SIDE_M) if isinstance(side, Mapping) and set(side) <= {"metres"} else None
    if not isinstance(metres, int | float) or isinstance(metres, bool) or not LEAST_M <= metres <= MOST_M:
        raise ValueError(
            f"{CUT}: {side!r} is not understood; write {CUT}: {{metres: 400}}, {LEAST_M:g} to {MOST_M:.0f}"
        )
    return keys, float(metres)
