"""The facade stages in order, on painted facades with known truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

import facade_core.facade.photo_facade
from benchmarks.painter.facade import paint_facade as paint
from facade_core.core.errors import ImageError
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.core.types import Element, Parsing
from facade_core.facade import exemplar
from facade_core.facade.evidence import Evidence
from facade_core.facade.exemplar import count_columns, measure_narrowest_shop, prepare_exemplar
from facade_core.facade.exemplar_facade import BuildingPaint, ScaledStyle, build_facade_from_exemplar
from facade_core.facade.facade import Facade
from facade_core.facade.layout.settings import MIN_PLAUSIBLE_SCORE
from facade_core.facade.photo_facade import build_facade_from_photo
from facade_core.facade.texture.building_walls import compose_wall
from facade_core.facade.texture.retargeting import analyse_exemplar
from facade_core.facade.texture.wall_floors import FacadeWall
from facade_core.facade.wall_material import lit_colour
from facade_core.parsing.occluders import remove_occluders_lining_hole
from facade_core.parsing.segmentation import Segmentation

PAINTED = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.06, seed=2, occluders=2)


def test_a_photo_is_kept_where_seen_and_completed_where_hidden() -> None:
    made = build_facade_from_photo(Evidence(image=PAINTED.image, hidden=PAINTED.occluded), seed=1)
    seen = ~made.occluded
    assert not seen[PAINTED.occluded].any()
    assert made.occluded.mean() < PAINTED.occluded.mean() + 0.05, (
        "beyond a rim, what is seen is mostly not called a tree"
    )
    np.testing.assert_array_equal(made.image[seen], PAINTED.image[seen])
    assert (made.provenance[seen] == Provenance.PHOTO).all()
    assert (made.provenance[~seen] == Provenance.INPAINTED).all()
    assert (made.image[~seen] != PAINTED.image[~seen]).any(axis=1).mean() > 0.8
    assert made.completion is not None
    assert made.estimates is not None
    assert made.estimates.low.floors <= made.floors == 4 <= made.estimates.high.floors
    assert made.estimates.low.windows < made.estimates.value.windows < made.estimates.high.windows
    assert 0 <= made.masked_share <= made.occluded.mean()
    assert set(made.seconds) >= {"parse", "elements", "complete", "inpaint", "lattice", "encode"}
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    with_things = np.abs(PAINTED.image[~seen].astype(int) - clean.image[~seen]).mean()
    completed = np.abs(made.image[~seen].astype(int) - clean.image[~seen]).mean()
    assert completed < 0.8 * with_things


@pytest.mark.parametrize(("style", "seed"), [("jugend", 5), ("haussmann", 7)])
def test_labels_and_elements_of_what_is_completed_are_those_of_its_picture(style: str, seed: int) -> None:
    painted = paint((13.0, 14.0), floors=4, columns=4, style=style, metres_per_pixel=0.06, seed=seed, occluders=2)
    made = build_facade_from_photo(Evidence(image=painted.image, hidden=painted.occluded, is_clean=True), seed=1)
    hidden = painted.occluded
    assert (made.labels[hidden] == painted.labels[hidden]).mean() > 0.86
    windows = [e for e in made.elements if e.label == "window"]
    assert windows
    for e in windows:
        assert (made.labels[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] == FacadeClass.WINDOW).mean() > 0.75
        assert e.confidence < 1, "what the parser reads is not certain"


@pytest.mark.long
def test_the_same_photo_and_seed_make_the_same_bits() -> None:
    one, two = (
        build_facade_from_photo(Evidence(image=PAINTED.image, hidden=PAINTED.occluded), seed=5) for _ in range(2)
    )
    np.testing.assert_array_equal(one.image, two.image)
    assert one.hierarchy.to_bytes() == two.hierarchy.to_bytes()


def test_a_photo_of_which_nothing_is_seen_is_refused() -> None:
    hidden = np.ones_like(PAINTED.occluded)
    with pytest.raises(ImageError, match=r"only 0\.0% of the facade is seen of it"):
        build_facade_from_photo(Evidence(image=PAINTED.image, hidden=hidden))
    hidden[100, 100] = False
    with pytest.raises(ImageError, match="5% are the least"):
        build_facade_from_photo(Evidence(image=PAINTED.image, hidden=hidden))


def test_an_exemplar_without_windows_is_refused() -> None:
    wall = np.full((160, 200, 3), 150, np.uint8)
    wall += np.random.default_rng(1).integers(0, 20, wall.shape).astype(np.uint8)
    with pytest.raises(ImageError, match="no windows are found"):
        prepare_exemplar(wall, np.zeros(wall.shape[:2], bool), floor_height=3.2)


def test_nothing_is_made_of_an_exemplar_that_nobody_keeps(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any, **__: Any) -> None:
        raise AssertionError("its variations are not kept")

    monkeypatch.setattr("facade_core.facade.photo_facade.encode", never)
    prepared = prepare_exemplar(PAINTED.image, PAINTED.occluded, floor_height=3.2)
    assert set(prepared.seconds) >= {"parse", "elements", "complete", "inpaint", "scale"}


def test_what_a_parse_of_an_exemplar_still_finds_is_filled_and_counts_against_its_ground_floor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="haussmann", metres_per_pixel=0.06, seed=2)
    person = np.zeros(clean.labels.shape, bool)
    person[-40:, 60:80] = True
    observe, found = exemplar.observe_photo, iter([np.zeros_like(person), person])

    def observe_and_add(evidence: Evidence, **more: Any) -> Evidence:
        seen = observe(evidence, **more)
        return replace(seen, hidden=seen.hidden | next(found)[-len(seen.hidden) :, -seen.hidden.shape[1] :])

    whole = prepare_exemplar(clean.image, np.zeros_like(person), floor_height=3.2)
    monkeypatch.setattr(exemplar, "observe_photo", observe_and_add)
    monkeypatch.setattr(exemplar, "trim_to_facade", lambda photo: (photo, (0, 0, *photo.hidden.shape[::-1])))
    again = prepare_exemplar(clean.image, np.zeros_like(person), floor_height=3.2)
    assert next(found, None) is None, "it is parsed twice"
    assert again.occluded[-20, 70 - (clean.labels.shape[1] - again.labels.shape[1])]
    assert again.quality.foot < whole.quality.foot


def test_the_narrowest_shop_is_no_error_of_the_parser() -> None:
    labels = np.zeros((40, 200), np.uint8)
    assert measure_narrowest_shop(labels, 0.1) == 0.0
    for left, right in ((10, 70), (90, 130), (150, 154)):
        labels[20:, left:right] = FacadeClass.SHOP
    assert measure_narrowest_shop(labels, 0.1) == pytest.approx(4.0)


def test_an_exemplar_is_trimmed_below_the_sky() -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    sky = np.full((40, clean.labels.shape[1], 3), (150, 190, 240), np.uint8)
    sky[:, : sky.shape[1] // 2] = clean.image[20, 5]  # beside a taller part
    picture = np.concatenate([sky, clean.image])
    prepared = prepare_exemplar(picture, np.zeros(picture.shape[:2], bool), floor_height=3.2)
    assert prepared.box[1] >= 36
    assert prepared.image.shape[0] == prepared.box[3] - prepared.box[1]


def test_a_coarse_exemplar_is_enlarged_smoothly() -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    made = build_facade_from_exemplar(
        ScaledStyle(analyse_exemplar(clean.image, clean.labels), 0.06),
        FacadeWall.freestanding(13.0, 16.0, floors=4),
        (650, 800),
        seed=3,
    )
    same = (made.image[1::3, :-1] == made.image[1::3, 1:]).all(axis=2)
    assert same.mean() < 0.5, "a pixel is not repeated as it is"


def test_a_photo_without_holes_needs_no_completion() -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="jugend", metres_per_pixel=0.06, seed=3)
    made = build_facade_from_photo(Evidence(image=clean.image, hidden=np.zeros(clean.labels.shape, bool)))
    assert made.completion is None
    np.testing.assert_array_equal(made.image, clean.image)


def test_a_wall_takes_an_exemplar_at_its_own_size() -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    made = build_facade_from_exemplar(
        ScaledStyle(analyse_exemplar(clean.image, clean.labels), 0.06),
        FacadeWall.freestanding(16.2, 20.0, floors=5),
        (270, 334),
        seed=3,
    )
    assert made.image.shape == (270, 334, 3)
    assert (made.provenance == Provenance.SYNTHESISED).all()
    assert not made.occluded.any()
    assert sum(e.label == "window" for e in made.elements) >= 15
    assert made.floors == 5
    assert made.estimates is None, "no picture tells"


@pytest.mark.parametrize("colour", [(150.0, 70.0, 60.0), (60.0, 60.0, 64.0), (225.0, 215.0, 190.0)])
def test_a_wall_is_painted_in_the_colour_of_its_building(colour: tuple[float, ...]) -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="jugend", metres_per_pixel=0.06, seed=2)
    style = ScaledStyle(analyse_exemplar(clean.image, clean.labels), 0.06)
    wall = FacadeWall.freestanding(16.2, 20.0, floors=5)
    usual = build_facade_from_exemplar(style, wall, (270, 334), seed=3)
    paint_ = BuildingPaint(wall_colour=np.array(colour))
    painted = build_facade_from_exemplar(style, wall, (270, 334), paint=paint_, seed=3)
    on = usual.labels == FacadeClass.WALL
    np.testing.assert_array_equal(painted.labels, usual.labels)
    np.testing.assert_allclose(lit_colour(painted.image[on]), colour, atol=6)
    inside = cv2.erode((usual.labels == FacadeClass.WINDOW).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    assert inside.any()
    np.testing.assert_array_equal(painted.image[inside], usual.image[inside])


def test_a_street_wall_takes_the_number_of_bays_of_which_the_scores_are_best(monkeypatch: pytest.MonkeyPatch) -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    style = ScaledStyle(analyse_exemplar(clean.image, clean.labels), 0.06)
    wall = FacadeWall.freestanding(13.0, 12.0, floors=4)
    usual = build_facade_from_exemplar(style, wall, (216, 200), seed=3)
    assert usual.plausibility is not None
    assert usual.plausibility > MIN_PLAUSIBLE_SCORE

    def count_window_columns(facade: Facade) -> int:
        return max(
            sum(e.label == "window" and abs(e.y0 - other.y0) < 4 for e in facade.elements) for other in facade.elements
        )

    def prefer_more(layout: tuple[Element, ...], domain: tuple[float, ...]) -> float:
        return len(layout) - 1000.0

    monkeypatch.setattr("facade_core.facade.exemplar_facade.score", prefer_more)
    more = build_facade_from_exemplar(style, wall, (216, 200), seed=3)
    assert count_window_columns(more) == count_window_columns(usual) + 1
    back = build_facade_from_exemplar(style, replace(wall, on_street=False, is_back=True), (216, 200), seed=3)
    assert back.hierarchy is not None
    assert len(back.hierarchy.levels) >= 1
    assert back.plausibility is not None


def test_a_back_is_drawn_at_twice_its_density_where_the_exemplar_is_finer(monkeypatch: pytest.MonkeyPatch) -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.05, seed=2)
    style = ScaledStyle(analyse_exemplar(clean.image, clean.labels), 0.05)
    front = FacadeWall.freestanding(16.0, 20.0, floors=5)
    back = replace(front, on_street=False, is_back=True)
    drawn: list[tuple[int, ...]] = []

    def seen(*given: Any, **named: Any) -> tuple[np.ndarray, np.ndarray]:
        picture, labels = compose_wall(*given, **named)
        drawn.append(labels.shape)
        return picture, labels

    monkeypatch.setattr("facade_core.facade.exemplar_facade.compose_wall", seen)
    fine, coarse, _ = (
        build_facade_from_exemplar(style, wall, (16 * of, 20 * of), seed=3)
        for wall, of in ((back, 20), (back, 5), (front, 5))
    )
    assert drawn == [(320, 400), (160, 200), (320, 400)]
    assert (coarse.labels == fine.labels[2::4, 2::4]).mean() > 0.95
    small = cv2.resize(fine.image, (100, 80), interpolation=cv2.INTER_AREA).astype(float)
    assert np.median(np.abs(small - coarse.image)) < 4


def test_an_exemplar_is_measured_and_measured() -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.05, seed=2)
    prepared = prepare_exemplar(clean.image, np.zeros(clean.labels.shape, bool), floor_height=3.2)
    assert prepared.metres_per_pixel == pytest.approx(0.05, rel=0.2)
    assert prepared.floors == 4
    assert (prepared.labels[0] == FacadeClass.SKY).mean() < 0.5
    assert (prepared.labels == FacadeClass.WALL).any()


def test_a_fine_exemplar_with_labels_is_counted_like_a_coarse_one_and_kept_as_fine() -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.05, seed=2)
    image, labels = (np.repeat(np.repeat(part, 4, axis=0), 4, axis=1) for part in (clean.image, clean.labels))
    coarse = prepare_exemplar(clean.image, np.zeros(clean.labels.shape, bool), floor_height=3.2, labels=clean.labels)
    fine = prepare_exemplar(image, np.zeros(labels.shape, bool), floor_height=3.2, labels=labels)
    assert (fine.floors, fine.columns) == (coarse.floors, coarse.columns)
    assert fine.metres_per_pixel == pytest.approx(coarse.metres_per_pixel / 4, rel=0.02)
    assert fine.shaded_share == pytest.approx(coarse.shaded_share, abs=0.05)
    np.testing.assert_array_equal(fine.image, image)


def test_labels_that_come_with_an_exemplar_are_believed() -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.05, seed=2)
    nothing = np.zeros(clean.labels.shape, bool)
    prepared = prepare_exemplar(clean.image, nothing, floor_height=3.2, labels=clean.labels)
    np.testing.assert_array_equal(prepared.labels, clean.labels)
    assert (prepared.floors, prepared.columns) == (4, 4)
    assert "parse" not in prepared.seconds
    hidden = nothing.copy()
    hidden[:40, :40] = True
    assert "parse" in prepare_exemplar(clean.image, hidden, floor_height=3.2, labels=clean.labels).seconds, (
        "what is hidden is made"
    )


def test_columns_are_counted_in_the_fullest_row() -> None:
    row = [Element("window", x, 10, x + 5, 20) for x in (0, 10, 20)] + [Element("window", 0, 30, 5, 40)]
    assert count_columns([*row, Element("door", 0, 40, 5, 60)]) == 3
    assert count_columns([]) == 0


def test_what_the_parser_sees_in_front_is_made_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    clean = paint((13.0, 14.0), floors=4, columns=4, style="brick", metres_per_pixel=0.06, seed=2)
    true_parse = facade_core.facade.photo_facade.parse_segmentation
    thing = np.zeros(clean.labels.shape, bool)
    thing[150:200, 40:90] = True
    thing[5, 5] = True  # a speck is noise

    def sees_a_thing(segmentation: Segmentation, hidden: np.ndarray) -> Parsing:
        found = true_parse(segmentation, hidden)
        return Parsing(found.labels, found.confidence, found.occluded | thing)

    monkeypatch.setattr(facade_core.facade.photo_facade, "parse_segmentation", sees_a_thing)
    made = build_facade_from_photo(Evidence(image=clean.image, hidden=np.zeros(clean.labels.shape, bool)))
    assert made.masked == ((40, 150, 90, 200),)
    assert made.occluded[149:201, 39:91].all()
    assert not made.occluded[:100].any()
    assert (made.provenance[160:190, 50:80] == Provenance.INPAINTED).all()
    np.testing.assert_array_equal(made.image[~made.occluded], clean.image[~made.occluded])


def test_a_thing_that_a_hole_crosses_is_hidden_up_to_it_and_what_lines_the_hole_is_none() -> None:
    hidden, occluded = np.zeros((2, 200, 200), bool)
    hidden[190:] = True  # where a rectified photo shows nothing
    occluded[150:, 40:120] = True  # a car
    occluded[184:, 150:180] = True  # the filling, seen as a thing
    believed = remove_occluders_lining_hole(occluded, hidden)
    assert believed[150:190, 40:120].all()
    assert not believed[:, 130:].any()
    assert not believed[hidden].any()
