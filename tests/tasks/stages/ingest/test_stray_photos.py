"""Photos whose name is no facade's id: the reason names the facade that is meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from tasks.stages.ingest.task import find_stray_photos

FACADES = [*(f"LYON_46-{wall}" for wall in range(5)), "LYON_46-21", "LYON_4-9", "w7-0"]


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("lyon_46-2", "the nearest is LYON_46-2"),
        ("LYON_46-2 (1)", "the nearest is LYON_46-2"),
        ("LYON_46-2 copy", "the nearest is LYON_46-2"),
        ("LYON_46-2 - Copy 2", "the nearest is LYON_46-2"),
        ("LYON_46", "the facades of this building are LYON_46-0, LYON_46-1, LYON_46-2 and 3 more"),
        ("w7", "the facades of this building are w7-0"),
        ("LYON_46-22", "the nearest is LYON_46-2"),
        ("IMG0001", "ids are in `streetloom query`"),
    ],
)
def test_the_reason_names_the_facade_that_is_meant(name: str, hint: str) -> None:
    file = Path(f"{name}.jpg")
    (stray,) = find_stray_photos({name: file, "w7-0": Path("w7-0.jpg")}, FACADES)
    assert stray == (file.name, f"no facade has the id {name}; {hint}; rename or remove the photo")
