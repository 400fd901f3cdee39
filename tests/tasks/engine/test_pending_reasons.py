"""Reasons of pending units: the kind of input in which the recorded key and the key of now differ."""

from __future__ import annotations

import pytest

from tasks.engine.pending_reasons import pending_reasons
from tasks.engine.unit import Unit


@pytest.mark.parametrize(
    ("recorded", "reason"),
    [
        ("code:1 exemplar:1", "new photo"),
        ("code:1 photo:2", "photo changed"),
        ("code:2 photo:1", "code or a library changed"),
    ],
)
def test_a_photo_is_new_where_there_was_none(recorded: str, reason: str) -> None:
    record = {"unit": "a-0", "key": recorded, "status": "done"}
    assert pending_reasons([record], [Unit(0, "a-0", ("code:1 photo:1",))]) == {0: reason}
    with_fallback = Unit(0, "a-0", ("code:1 photo:1", "code:1 photo:1 exemplar:1"))
    assert pending_reasons([record], [with_fallback]) == {0: reason}
