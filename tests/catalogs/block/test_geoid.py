"""Height of the geoid, and the key that asks for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from catalogs.block.geoid import geoid_height
from catalogs.block.key_faults import validate_block_settings
from catalogs.block.reader import read_block
from catalogs.crs import have_heights_above_sea
from tests.pipeline.stages import write_block

KEYS = {"name": "a", "buildings": {"path": "a.geojson"}}


@pytest.mark.parametrize(
    ("longitude", "latitude", "metres"),
    [
        (11.58, 48.14, 45.48),
        (24.9456, 60.1675, 17.87),
        (-73.9857, 40.7484, -32.66),
        (80.0, 4.0, -105.7),
        (180.0, -16.0, 51.59),
        (-180.0, -16.0, 51.59),
        (0.0, 90.0, 13.61),
    ],
)
def test_heights_of_the_geoid(longitude: float, latitude: float, metres: float) -> None:
    assert geoid_height(longitude, latitude) == pytest.approx(metres, abs=0.1)


def test_an_automatic_separation_is_that_of_the_model_with_a_note(tmp_path: Path) -> None:
    texture = {"walls": "translate"}
    found = read_block(write_block(tmp_path / "auto", texture=texture, geoid_separation="auto"))
    assert found.geoid_separation == pytest.approx(17.9, abs=0.2)
    assert any(
        note.startswith(f"geoid_separation: {found.geoid_separation:.2f} m, that of EGM96") for note in found.notes
    )
    stated = read_block(write_block(tmp_path / "stated", texture=texture, geoid_separation=found.geoid_separation))
    assert stated.geoid_separation == found.geoid_separation
    assert not any("EGM96" in note for note in stated.notes)


@pytest.mark.parametrize(
    ("names", "above"),
    [
        (["EPSG:7415"], True),
        (["EPSG:25832+5783", "EPSG:7415"], True),
        (["EPSG:4979"], False),
        (["EPSG:28992"], False),
        (["EPSG:7415", "EPSG:28992"], False),
        ([], False),
    ],
)
def test_systems_state_what_their_heights_are_above(names: list[str], above: bool) -> None:
    assert have_heights_above_sea(names) == above


def test_heights_above_the_sea_have_the_separation_of_the_model(tmp_path: Path) -> None:
    file = write_block(tmp_path, texture={"walls": "translate"})
    file.write_text(file.read_text().replace("crs: EPSG:32635\n", "crs: EPSG:32635+3855\n", 1))
    found = read_block(file)
    assert found.geoid_separation == pytest.approx(17.9, abs=0.2)


def test_other_words_are_refused() -> None:
    assert validate_block_settings({**KEYS, "geoid_separation": 17.5}).geoid_separation == 17.5
    with pytest.raises(ValueError, match="geoid_separation"):
        validate_block_settings({**KEYS, "geoid_separation": "automatic"})
