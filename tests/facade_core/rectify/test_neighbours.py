"""Party walls between painted facades in a row, and the sides of the one that a photo is meant for."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from benchmarks.painter.facade import PaintedFacade, paint_facade
from facade_core.core.labels import FacadeClass
from facade_core.imagery.rectify import building_crop
from facade_core.imagery.rectify.building_crop import crop_to_facade
from facade_core.imagery.rectify.neighbours import GapEvidence, choose_sides, measure_gaps
from facade_core.parsing.segmenter import Surroundings

HEIGHT = 480


def on_street(facade: PaintedFacade) -> tuple[np.ndarray, np.ndarray]:
    """Image and labels of a facade that stands on the lowest row of HEIGHT rows, below a sky."""
    height, width = facade.labels.shape
    image, labels = np.full((HEIGHT, width, 3), (150, 180, 220), np.uint8), np.full((HEIGHT, width), 6, np.uint8)
    image[HEIGHT - height :], labels[HEIGHT - height :] = facade.image, facade.labels
    return image, labels


def paint_row(*facades: PaintedFacade) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Image, labels and party walls, with a downpipe each, of facades in a row."""
    parts = [on_street(facade) for facade in facades]
    ends = np.cumsum([labels.shape[1] for _, labels in parts]).tolist()
    image, labels = (np.concatenate(one, axis=1) for one in zip(*parts, strict=True))
    for end in ends[:-1]:
        image[60:, end - 2 : end + 2] = (90, 90, 85)
    return image, labels, ends[:-1]


def paint(width: float, height: float, seed: int, floors: int = 5, columns: int = 4) -> PaintedFacade:
    return paint_facade(
        (height, width), floors=floors, columns=columns, style="haussmann", metres_per_pixel=0.035, seed=seed
    )


def find_sides(image: np.ndarray, labels: np.ndarray, aspect: float | None = None) -> tuple[int, int]:
    gaps = measure_gaps(image, labels, labels == 6)
    return choose_sides(gaps, labels.shape, labels.shape[1] / 2, aspect, np.ones(labels.shape[1]))


def test_a_facade_between_neighbours_is_told_from_them() -> None:
    image, labels, (left, right) = paint_row(paint(6, 14.6, 3, columns=2), paint(12, 15.8, 7), paint(7, 15.0, 5))
    found = find_sides(image, labels)
    assert np.abs(np.array(found) - (left, right)).max() <= 6


def test_an_exemplar_is_cropped_to_the_facade_in_its_middle(monkeypatch: pytest.MonkeyPatch) -> None:
    image, labels, (left, right) = paint_row(paint(6, 14.6, 3, columns=2), paint(12, 15.8, 7), paint(7, 15.0, 5))
    seen = Surroundings(labels == FacadeClass.SKY, labels)
    monkeypatch.setattr(building_crop, "segment_surroundings", lambda image, hidden, model: seen)
    found = crop_to_facade(image, np.zeros(labels.shape, bool))
    assert np.abs(np.array(found.box)[[0, 2]] - (left, right)).max() <= 6
    assert found.notes == ("neighbour on the left and right cut off",)


def test_a_facade_without_neighbours_stays_whole() -> None:
    for seed in (1, 4, 9):
        image, labels, _ = paint_row(paint(14, 15.5, seed))
        assert find_sides(image, labels) == (0, image.shape[1])


def gap(column: int, party_wall: bool) -> GapEvidence:
    return GapEvidence(column, np.array([1.0, 0.8, 0.85, 0.1] if party_wall else [0.3, 0.1, 0.5, 0.08]))


def choose(
    gaps: list[GapEvidence], size: tuple[int, int], centre: float, aspect: float | None = None
) -> tuple[int, int]:
    """Sides in a picture that is wholly seen."""
    return choose_sides(gaps, size, centre, aspect, np.ones(size[1]))


def test_what_the_photo_was_pointed_at_is_taken() -> None:
    gaps = [gap(150, False), gap(300, True), gap(500, False), gap(700, True)]
    assert choose(gaps, (600, 1000), 500.0) == (300, 700)
    assert choose(gaps, (600, 1000), 100.0) == (0, 300)
    assert choose([], (600, 1000), 500.0) == (0, 1000)


def test_a_wider_neighbour_is_not_taken_for_the_house_that_the_photo_was_pointed_at() -> None:
    gaps = [gap(100, False), gap(200, True), gap(500, False), gap(700, False)]
    assert choose(gaps, (600, 1000), 150.0) == (0, 200)


def test_nothing_is_cut_off_where_the_photo_was_pointed_beside_the_picture() -> None:
    assert choose([gap(300, True), gap(700, True)], (600, 1000), 9000.0) == (0, 1000)


def test_a_part_that_is_mostly_not_seen_is_no_facade() -> None:
    gaps = [gap(150, False), gap(400, True), gap(700, False)]
    seen = np.ones(1000)
    assert choose_sides(gaps, (1000, 1000), 900.0, None, seen) == (400, 1000)
    seen[400:] = 0.4
    assert choose_sides(gaps, (1000, 1000), 900.0, None, seen) != (400, 1000)


def test_what_continues_beyond_one_column_of_windows_is_one_facade() -> None:
    side = paint(6, 14.6, 3, columns=2)
    image, labels, (left, right) = paint_row(side, paint(4, 14.6, 8, columns=1), side)
    bay = np.s_[60:, left + 2 : right - 2]
    image[bay], labels[bay] = image[bay][::-1].copy(), labels[bay][::-1].copy()
    mismatches = {
        near: gap.features[0]
        for gap in measure_gaps(image, labels, labels == 6)
        for near in (left, right)
        if abs(gap.column - near) <= 6
    }
    assert len(mismatches) == 2
    assert max(mismatches.values()) < 0.1


def test_edges_in_a_tree_are_no_line() -> None:
    image, labels, (party_wall,) = paint_row(paint(6, 14.6, 3, columns=2), paint(6, 15.8, 7, columns=2))
    leaves = np.s_[:, party_wall - 60 : party_wall + 60]
    in_tree = image.copy()
    in_tree[leaves] = np.random.default_rng(0).integers(20, 200, (HEIGHT, 120, 3))
    lines = [
        {gap.column: gap.features[2] for gap in measure_gaps(picture, labels, labels == 6)}
        for picture in (image, in_tree)
    ]
    assert max(lines[0].values()) > 0.6
    assert max(line for column, line in lines[1].items() if abs(column - party_wall) < 60) < 0.75


def test_a_single_column_of_windows_is_a_facade_only_if_the_wall_is_as_narrow() -> None:
    gaps = [gap(400, True)]
    assert choose(gaps, (1000, 1000), 800.0) == (0, 1000)
    assert choose(gaps, (1000, 1000), 800.0, 0.6) == (400, 1000)


def test_the_proportions_of_the_wall_decide_in_doubt() -> None:
    doubtful = GapEvidence(600, np.array([0.8, 0.3, 0.73, 0.1]))
    assert choose([doubtful], (600, 1000), 500.0, 1.0) == (0, 600)
    assert choose([doubtful], (600, 1000), 500.0, 1000 / 600) == (0, 1000)


@pytest.mark.parametrize("shape", [(40, 3), (3, 40), (500, 20)])
def test_pictures_too_small_for_windows_have_no_gaps(shape: tuple[int, int]) -> None:
    image, labels = np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
    assert measure_gaps(image, labels, np.zeros(shape, bool)) == []


def test_a_wide_picture_takes_no_more_memory_than_one_five_times_as_wide_as_high() -> None:
    image, labels, _ = paint_row(paint(12, 15.8, 7), paint(12, 15.8, 7))
    peaks = []
    for repeats in (3, 30):
        wide = np.tile(image, (1, repeats, 1)), np.tile(labels, (1, repeats))
        tracemalloc.start()
        found = measure_gaps(*wide, wide[1] == 6)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert len(found) >= 4 * repeats
    assert peaks[1] < 1.5 * peaks[0]
