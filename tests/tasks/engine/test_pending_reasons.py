"""Reasons of pending units: the first input that differs from those of the record."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from tasks.engine.inputs import CODE, digest_inputs, digest_values, input_field
from tasks.engine.pending import _pieces
from tasks.engine.pending_reasons import pending_reasons
from tasks.engine.unit import Unit


@dataclass(frozen=True)
class Pictured:
    photo: Path | None = input_field("photo changed", new="new photo")
    exemplar: str = input_field("exemplar changed")


@pytest.mark.parametrize(
    ("recorded", "reason"),
    [
        ("code:1 photo:{nothing} exemplar:2", "new photo"),
        ("code:1 photo:2", "photo changed"),
        ("code:2 photo:{photo}", "code or a library changed"),
        ("code:1 photo:{photo} exemplar:1", "exemplar changed"),
    ],
)
def test_a_photo_is_new_where_there_was_none(tmp_path: Path, recorded: str, reason: str) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"a")
    inputs = Pictured(path, "brick")
    unit = Unit(0, "a-0", inputs, digests={CODE: "1"} | digest_inputs(inputs))
    key = recorded.format(photo=unit.digests["photo"], nothing=digest_values(photo=None)["photo"])
    assert pending_reasons([{"unit": "a-0", "key": key, "status": "done"}], [unit]) == {0: reason}
    assert pending_reasons([{"unit": "a-0", "key": unit.key, "status": "failed"}], [unit]) == {0: "not done before"}
    assert (
        pending_reasons([{"unit": "a-0", "key": f"code:1 photo:{unit.digests['photo']}", "status": "done"}], [unit])
        == {}
    )


def test_corrected_groups_come_first() -> None:
    units = [Unit(i, f"{i}", None, group_id=i // 2, is_corrected=i == 5) for i in range(6)]
    assert [[unit.index for unit in piece] for piece in _pieces(units)] == [[4, 5], [0, 1], [2, 3]]
