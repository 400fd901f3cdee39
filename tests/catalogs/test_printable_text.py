"""Lines of messages: units with reasons."""

from __future__ import annotations

import pytest

from catalogs.printable_text import format_unit_reason


@pytest.mark.parametrize(
    ("unit", "reason", "line"),
    [
        ("7", "crosses itself; mend it", "7: crosses itself; mend it"),
        ("a.jpg", "a.jpg is cut off; replace it", "a.jpg: it is cut off; replace it"),
        ("a.jpg", "a.jpg: its name holds a line break", "a.jpg: its name holds a line break"),
        ("7", "footprint 7 has no geometry; draw it", "7: it has no geometry; draw it"),
        ("7", "footprint 77 has no geometry; draw it", "7: footprint 77 has no geometry; draw it"),
        ("a", "a.jpg is cut off; replace it", "a: a.jpg is cut off; replace it"),
    ],
)
def test_a_unit_is_named_once(unit: str, reason: str, line: str) -> None:
    assert format_unit_reason(unit, reason) == line
