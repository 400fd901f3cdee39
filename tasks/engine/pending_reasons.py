"""Reasons for which a unit is pending, by the kind of input that changed."""

from __future__ import annotations

from collections.abc import Sequence

from facade_core.atlas.journal import Record
from tasks.engine.outcome import is_done_for_keys
from tasks.engine.unit import Unit
from tasks.engine.unit_key import diff_key_parts, split_key

# A viewpoint's view digests changed.
VIEW_CHANGED = "visible surfaces changed"
# Charts that the unit reads are written again.
READS_AGAIN = "surfaces that they show are pending"
# Streets of earlier waves, or settings of theirs, changed.
STREETS_CHANGED = "texels of other streets changed"
# By part of a key; the first that differs is reported.
REASONS = {
    "corrected": "corrected",
    "photo": "photo changed",
    "picture": "picture changed",
    "earlier": "panoramas of an earlier capture changed",
    "panoramas": "panoramas or their poses changed",
    "pose": "pose changed",
    "exemplar": "exemplar changed",
    "models": "block's models changed",
    "own": "own texture changed",
    "aerial": "orthophoto changed",
    "entrances": "entrances of the map changed",
    "beside": "surroundings changed",
    "between": "surroundings changed",
    "above": "surroundings changed",
    "around": "surroundings changed",
    "lines": "streets changed",
    "views": VIEW_CHANGED,
    "seeds": "their inputs are pending",
    "streets": "their inputs are pending",
    "geometry": "geometry changed",
    "walls": "block's texture.walls changed",
    "settings": "block's settings changed",
    "code": "code or a library changed",
    "house": "pictures of the building changed",
}
# The unit has a photo, and had none when it was done.
NEW_PHOTO = "new photo"
# The journal has no record of the unit.
NEW = "new"
# The record has the unit's key, but says failed or stale.
NOT_DONE = "not done before"


def pending_reasons(records: Sequence[Record | None], units: Sequence[Unit]) -> dict[int, str]:
    """Return the reason of each unit that is done by none of its keys, by index."""
    return {
        u.index: _reason(records[u.index], u.keys) for u in units if not is_done_for_keys(records[u.index], *u.keys)
    }


def _reason(record: Record | None, keys: tuple[str, ...]) -> str:
    if record is None:
        return NEW
    if record["key"] in keys:
        return NOT_DONE
    changed = min((diff_key_parts(record["key"], key) for key in keys), key=len)
    part = next((part for part in REASONS if part in changed), "settings")
    return NEW_PHOTO if part == "photo" and part not in split_key(record["key"]) else REASONS[part]
