"""What the benchmark of looks counts, on pictures of which the answer is known."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.blind_answers import count_answers, write_key
from benchmarks.blind_pairs import sheet
from benchmarks.look.likeness import _wall_distance, gradient_energy, relative_energy
from benchmarks.look.photos import panorama_places, perspective
from benchmarks.look.repeats import autocorrelation, highest_peak, material, standing_out
from benchmarks.look.walls import _in_triangle, _likeness, _roof_shape, _to_boxes
from facade_core.street.materials.procedural import plaster_tone

KEY = {"pairs": {"1": {"A": "out", "B": "against"}, "2": {"A": "against", "B": "out"}}}


def test_tiles_are_found_at_their_period_and_noise_is_not() -> None:
    rng = np.random.default_rng(1)
    everywhere = np.ones((192, 192), bool)

    def shared(tiled: bool) -> tuple[float, float, float]:
        maps = []
        for _ in range(4):
            grain = rng.normal(0, 20, (32, 32) if tiled else (192, 192))
            streaks = np.repeat(np.repeat(rng.normal(0, 6, (1, 24)), 8, 1), 192, 0)  # they have no period
            patch = 128 + streaks + (np.tile(grain, (6, 6)) if tiled else grain)  # 4 m at 8 pixels a metre
            maps.append(autocorrelation(patch.astype(np.float32), everywhere))
        return highest_peak(standing_out(np.array(maps)))

    peak, *shift = shared(True)
    assert peak > 0.7
    assert {abs(value) % 4 for value in shift} == {0.0}
    assert shared(False)[0] < 0.1


def test_lines_and_streaks_are_no_period_and_a_tile_is() -> None:
    rng = np.random.default_rng(1)
    everywhere = np.ones((192, 192), bool)
    found = {}
    for name in ("tile", "line", "streak"):
        maps = []
        for _ in range(4):
            grain = rng.normal(0, 20, (192, 192))
            if name == "tile":
                grain = np.tile(rng.normal(0, 20, (32, 32)), (6, 6))
            elif name == "line":
                grain[90:93] += 120
            else:
                grain += np.repeat(rng.normal(0, 30, (1, 192)), 192, 0)
            maps.append(autocorrelation((128 + grain).astype(np.float32), everywhere))
        found[name] = highest_peak(standing_out(np.array(maps), both=True))[0]
    assert found["tile"] > 0.7
    assert found["line"] < 0.1
    assert found["streak"] < 0.1


def test_plaster_is_not_like_itself_farther_down() -> None:
    y, x = (np.mgrid[:576, :768] + 0.5) / 32 + 100
    tones = np.ones(x.size)
    plaster_tone(x.ravel(), y.ravel(), np.full(x.size, 9.0), np.full(x.size, 1 / 32), 7, tones)
    grey = 150 * tones.reshape(144, 4, 192, 4).mean(axis=(1, 3))
    likeness = autocorrelation(grey.astype(np.float32), np.ones(grey.shape, bool))
    assert likeness is not None
    assert highest_peak(likeness)[0] < 0.2


def test_what_is_even_or_marked_is_no_material() -> None:
    rng = np.random.default_rng(1)
    grey = rng.normal(90, 6, (192, 192)).astype(np.float32)
    grey[:, :96] = 90
    grey[40:60, 150:160] = 180
    shown = material(grey, np.ones((192, 192), bool))
    assert not shown[:, :94].any()
    assert not shown[40:60, 150:160].any()
    assert shown[100:, 110:].all()
    assert autocorrelation(grey, shown & False) is None


def test_a_part_of_a_facade_is_found_in_its_twin_alone() -> None:
    rng = np.random.default_rng(2)
    one, other = (rng.normal(0, 20, (120, 150)).astype(np.float32) for _ in range(2))
    assert _likeness(one, np.roll(one, 9, axis=1)) > 0.9
    assert _likeness(one, other) < 0.5


def test_gradients_are_relative_to_brightness_and_by_distance() -> None:
    ramp = np.repeat(np.repeat(np.arange(50, 150, dtype=np.uint8)[None], 20, 0)[..., None], 3, 2)
    distance = np.full((20, 100), 15.0)
    distance[:, 50:] = 100.0
    half = relative_energy([gradient_energy(ramp, distance, np.ones((20, 100), bool))])
    value, pixels = half[15.0]
    assert pixels == 1000
    assert value == pytest.approx(1 / np.arange(50, 100).mean() ** 2, rel=0.01)
    assert half[40.0] == (None, 0)
    assert half[5.0] == (None, 0)


def test_a_view_of_a_panorama_shows_what_lies_in_its_direction() -> None:
    panorama = np.zeros((512, 1024, 3), np.uint8)
    panorama[..., 0] = (np.arange(1024) // 4)[None]
    view = perspective(panorama, 90.0, 0.0, (60, 80))
    assert view.shape == (60, 80, 3)
    assert view[30, 40, 0] == pytest.approx(192, abs=1)
    assert view[30, 60, 0] > view[30, 40, 0] > view[30, 20, 0]


def test_a_marked_wall_is_as_far_as_its_foot_says() -> None:
    # 2.3 m below the camera and 45 degrees down: 2.3 m away; the wall runs across the view ahead
    down = (0.5 + 0.25) * 2048
    aside = (0.5 + np.arctan(0.5) / (2 * np.pi)) * 4096
    foot = (0.5 + np.arctan(2.3 / np.hypot(2.3, 1.15)) / np.pi) * 2048
    u, v = panorama_places(0.0, 0.0, (61, 81), samples=1)
    away = _wall_distance(u, v, [2048, down, aside, foot, 1800, 2300, 1, 4])
    assert away[30, 40] == pytest.approx(2.3, rel=0.02)
    assert np.isinf(away[0, 0])


def test_distance_to_a_window_is_measured_round_its_edges() -> None:
    window = np.array([[[0.0, 0, 2], [1.0, 0, 1]]])
    points = np.array([[0.5, 0, 1.5], [0.5, 0, 4.0], [4.0, 0, 1.5], [0.5, 3, 1.5]])
    assert _to_boxes(points, window).tolist() == pytest.approx([0, 2, 3, 3])
    assert np.isinf(_to_boxes(points, np.empty((0, 2, 3)))).all()


def test_places_in_a_triangle() -> None:
    corners = np.array([[0, 0], [4, 0], [0, 4.0]])
    for triangle in (corners, corners[::-1]):
        assert _in_triangle(np.array([[1, 1], [3, 3], [0, 0]]), triangle).tolist() == [True, False, True]


def test_roofs_are_told_by_the_sides_they_slope_to() -> None:
    side = np.array([[0.5, 0, 0.87], [-0.5, 0, 0.87], [0, 0, 1.0]])
    assert _roof_shape(side[2:], np.ones(1)) == "flat"
    assert _roof_shape(side[:2], np.ones(2)) == "2 sides"
    assert _roof_shape(np.empty((0, 3)), np.empty(0)) == "none"


def test_answers_are_counted_by_the_key() -> None:
    answers = [
        {"pair": "1", "preferred": "a", "why": "kerbs; light"},
        {"pair": "2", "preferred": "B", "why": "light"},
    ]
    assert count_answers(answers, KEY)["preferred"] == {"out": 2, "against": 0, "neither": 0}
    assert count_answers(answers, KEY)["why"] == {"out": {"light": 2, "kerbs": 1}}
    assert count_answers([{"pair": "2", "preferred": "", "why": ""}], KEY)["preferred"]["neither"] == 1


@pytest.mark.parametrize("answer", [{"pair": "3", "preferred": "A"}, {"pair": "1", "preferred": "left"}])
def test_an_answer_that_fits_no_pair_is_refused(answer: dict[str, str]) -> None:
    with pytest.raises(SystemExit, match="say A, B or nothing"):
        count_answers([{"why": "", **answer}], KEY)


def test_answers_count_by_the_key_that_is_written_with_them(tmp_path: Path) -> None:
    write_key(tmp_path, [("out", "against"), ("against", "out")], seed=3)
    key = json.loads((tmp_path / "key.json").read_text(encoding="utf-8"))
    assert key == {"seed": 3, **KEY}
    with (tmp_path / "answers.csv").open(encoding="utf-8", newline="") as file:
        answers = [row | {"preferred": "A"} for row in csv.DictReader(file)]
    assert count_answers(answers, key)["preferred"] == {"out": 1, "against": 1, "neither": 0}


def test_a_sheet_holds_all_its_pairs() -> None:
    dark, bright = np.zeros((20, 30, 3), np.uint8), np.full((20, 30, 3), 200, np.uint8)
    drawn = sheet([(dark, bright)] * 3, 1)
    assert (drawn == 200).all(axis=2).sum() == 3 * 20 * 30
