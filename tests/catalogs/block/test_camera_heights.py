"""Heights of cameras of another datum than the ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from catalogs.block.camera_heights import correct_camera_heights
from catalogs.block.reader import read_block
from catalogs.readers.pictures.panoramas import PosedPanorama
from facade_core.core.types import Building, ElevationRaster, Pose

USUAL = 2.5


def buildings(*bases: float | None) -> list[Building]:
    """Return houses 20 m apart along x."""
    return [
        Building(str(i), shapely.box(20.0 * i, 10.0, 20.0 * i + 10.0, 20.0), 9.0, "height", base=base)
        for i, base in enumerate(bases)
    ]


def cameras(*heights: float | None) -> list[PosedPanorama]:
    """Return panoramas 20 m apart, in front of the houses."""
    return [PosedPanorama(f"p{i}", Path(f"p{i}.jpg"), Pose(20.0 * i + 5.0, 0.0, z, 0.0)) for i, z in enumerate(heights)]


def correct_heights(heights: list[float | None], bases: list[float | None], terrain: ElevationRaster | None = None):
    found, notes = correct_camera_heights(cameras(*heights), buildings(*bases), terrain, USUAL)
    return [one.pose.z for one in found], notes


@pytest.mark.parametrize(
    ("heights", "bases"),
    [
        ([2.5, 3.0, None], [None] * 3),
        ([14.5, 15.0, 0.5 + 12], [12.0] * 3),
        ([None, None], [40.0, 41.0]),
        ([5.0], [0.0]),
        ([2.5, 2.4, 2.6], [0.4] * 3),
        ([4.0, 4.1, 4.2], [1.5] * 3),
    ],
)
def test_plausible_and_absent_heights_stay(heights: list[float | None], bases: list[float | None]) -> None:
    assert correct_heights(heights, bases) == (heights, ())


@pytest.mark.parametrize("z", [14.5, 31.9, -40.0, 0.0, 0.2, 2540.0, 5.2, 7.4, -2.2])
def test_heights_over_ground_of_unknown_height_are_ignored(z: float) -> None:
    found, (note,) = correct_heights([z, z + 0.4, 2.0], [None] * 3)
    assert found == [None] * 3
    assert "of another datum ignored" in note
    assert note.endswith("whose height no source states; give terrain: {path: ...}, or leave z out: 3 (p0, p1, p2)")


@pytest.mark.parametrize("z", [5.2, 7.4, 0.6])
def test_unusual_heights_over_ground_of_unknown_height_are_ignored(z: float) -> None:
    found, (note,) = correct_heights([z, z + 0.1, z + 0.2], [None] * 3)
    assert found == [None] * 3
    assert "(a camera is 1 to 5 m), whose height no source states" in note


@pytest.mark.parametrize("base", [-4.7, -3.2, 1.6, 2.4])
def test_usual_heights_that_the_datum_makes_unusual_are_above_the_ground(base: float) -> None:
    found, (note,) = correct_heights([2.5, 2.4, 2.6], [base] * 3)
    assert found == pytest.approx([base + 2.5, base + 2.4, base + 2.6])
    assert note == "camera heights taken as heights above the ground, not of its datum: 3 (p0, p1, p2)"


@pytest.mark.parametrize(("above", "base"), [(6.0, 40.0), (7.9, 0.0), (0.7, 12.0)])
def test_unusual_heights_are_kept_with_a_note(above: float, base: float) -> None:
    heights = [base + above, base + above, None]
    found, (note,) = correct_heights(heights, [base] * 3)
    assert found == heights
    assert note.startswith(f"camera heights kept, {above:.1f} m above the ground (most cameras are 1 to 5 m)")
    sunken = "; if the buildings begin below the ground, give terrain: {path: ...}" if above > 5.0 else ""
    assert note.endswith(f"mend z, or leave it out{sunken}: 2 (p0, p1)")


@pytest.mark.parametrize("base", [-2.0, -0.6, 0.8])
def test_heights_of_two_usual_readings_keep_their_datum_with_a_note(base: float) -> None:
    found, (note,) = correct_heights([2.5, 2.5, 2.6], [base] * 3)
    assert found == [2.5, 2.5, 2.6]
    assert note.startswith(f"camera heights read in the datum of the ground, {2.5 - base:.1f} m above it")


@pytest.mark.parametrize("offset", [18.2, 45.7, -31.0, 6.0])
def test_a_common_offset_is_removed(offset: float) -> None:
    stated = [10.0 + offset + 2.3, 11.0 + offset + 2.5, None, 12.0 + offset + 2.7]
    found, (note,) = correct_heights(stated, [10.0, 11.0, 11.5, 12.0])
    assert found[2] is None
    assert [z for z in found if z is not None] == pytest.approx([12.3, 13.5, 14.7], abs=0.05)
    assert "another datum than the ground" in note
    assert ("lowered by" if offset > 0 else "raised by") in note
    assert note.endswith(": 3 (p0, p1, p3)")


def test_heights_above_the_ground_are_added_to_it() -> None:
    slope = ElevationRaster(-50.0, 50.0, 1.0, np.tile(np.arange(200, dtype=np.float32), (101, 1)))
    found, (note,) = correct_heights([2.0, 2.2, 1.8], [None] * 3, slope)
    assert found == pytest.approx([57.0, 77.2, 96.8])
    assert "heights above the ground" in note


def test_single_outliers_are_ignored() -> None:
    found, (note,) = correct_heights([12.5, 12.4, 60.0, 12.6], [10.0] * 4)
    assert found == [12.5, 12.4, None, 12.6]
    assert note.endswith("50.0 m above the ground (a camera is 0.5 to 8 m), mend z, or leave it out: 1 (p2)")
    found, notes = correct_heights([32.5, 32.4, 160.0, 32.6], [10.0] * 4)
    assert found == [pytest.approx(12.45), pytest.approx(12.35), None, pytest.approx(12.55)]
    assert len(notes) == 2


def test_heights_without_a_common_offset_are_ignored() -> None:
    found, (note,) = correct_heights([50.0, 90.0, 130.0, 170.0], [10.0] * 4)
    assert found == [None] * 4
    assert "40.0 to 160.0 m above the ground" in note


def test_heights_beyond_the_known_terrain() -> None:
    heights = np.full((101, 200), np.nan, np.float32)
    found, (note,) = correct_heights([50.0, 90.0], [None] * 2, ElevationRaster(-50.0, 50.0, 1.0, heights))
    assert found == [None] * 2
    assert "whose height no source states" in note
    found, (note,) = correct_heights([50.0, 90.0], [10.0] * 2, ElevationRaster(-50.0, 50.0, 1.0, heights))
    assert found == [None] * 2, "40 and 80 m above the buildings' ground have no common offset"
    heights[:, :60] = 40.0
    found, (note,) = correct_heights([540.0, 540.2, 540.1], [None] * 3, ElevationRaster(-50.0, 50.0, 1.0, heights))
    assert found == pytest.approx([42.4, 42.6, 42.5]), "two of the cameras are over unknown ground"


def test_sea_level_heights_over_flat_ground(data: Path) -> None:
    folder = data / "field_inputs"
    if not folder.is_dir():
        pytest.skip("no field inputs in the data folder")
    plain, above_sea = (read_block(folder / name / "block.yaml") for name in ("pano-plain", "pano-z-sea-level"))
    assert [one.pose for one in above_sea.panoramas] == [one.pose for one in plain.panoramas]
    assert any("of another datum" in note for note in above_sea.notes)
    assert not any("of another datum" in note for note in plain.notes)
