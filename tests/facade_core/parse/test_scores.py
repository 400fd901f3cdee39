import numpy as np
import pytest

from benchmarks import in_front
from benchmarks.parsing import confusion, f1, matches, measure_behind, measure_occluders, put_in_front, scores, unseen
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.core.types import Element
from training.datasets.facades import LabelledFacade


def test_scores_of_a_small_confusion():
    truth = np.array([[FacadeClass.WALL, FacadeClass.WALL, FacadeClass.WALL, FacadeClass.WINDOW, UNKNOWN]], np.uint8)
    parsed = np.array(
        [[FacadeClass.WALL, FacadeClass.WALL, FacadeClass.WINDOW, FacadeClass.WINDOW, FacadeClass.WINDOW]], np.uint8
    )
    found = scores(confusion(truth, parsed))
    assert found["pixel_accuracy"] == 0.75
    assert found["mean_class_accuracy"] == pytest.approx((2 / 3 + 1) / 2, abs=1e-4)
    assert found["iou"] == {"wall": pytest.approx(2 / 3, abs=1e-4), "window": 0.5}


def test_elements_are_paired_one_to_one_at_half_overlap():
    true = [Element("window", 0, 0, 10, 10), Element("window", 20, 0, 30, 10), Element("door", 0, 50, 5, 60)]
    found = [
        Element("window", 0, 0, 10, 11),
        Element("window", 0, 1, 10, 10),  # a second one on the same window
        Element("window", 26, 0, 36, 10),  # overlaps too little
    ]
    counts = matches(true, found)
    assert [counts["window", which] for which in ("true", "found", "both")] == [2, 3, 1]
    assert f1(counts, "window") == pytest.approx(2 / 5)
    assert f1(counts, "door") == 0
    assert f1(counts, "shop") is None


def test_facades_trained_on_are_left_out():
    from facade_core.core.model_file import read_model_record
    from facade_core.parsing.segmenter import DEFAULT_MODEL

    trained_on = next(name for name in read_model_record(DEFAULT_MODEL)["training_set"] if name.startswith("ecp/"))
    empty = np.zeros((2, 2), np.uint8)
    facades = [LabelledFacade(name, empty, empty, empty, empty, empty) for name in (trained_on[4:], "new")]
    assert [facade.name for facade in unseen(facades, "ecp", None)] == ["new"]
    assert len(list(unseen(facades, "artdeco", None))) == 2


def test_occluders_where_it_is_known():
    image = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
    occluder = np.zeros((64, 64), np.uint8)
    occluder[:16], occluder[16:32] = 1, UNKNOWN
    photo = LabelledFacade("a", image, *[occluder] * 4)
    found = measure_occluders([photo])
    assert found["images"] == 1
    assert 0 <= found["iou"] <= found["recall"] <= 1


def test_what_is_guessed_behind_pieces_is_scored_apart():
    rng = np.random.default_rng(0)
    labels = np.full((120, 90), FacadeClass.WALL, np.uint8)
    labels[:60] = UNKNOWN
    facade = LabelledFacade("a", rng.integers(90, 160, (120, 90, 3), dtype=np.uint8), *[labels] * 4)
    pieces = [np.full((40, 20, 4), 255, np.uint8) for _ in range(3)]
    found = measure_behind([facade], pieces)
    assert found["images"] == 1
    assert 0 <= found["recall"] <= 1
    assert 0 <= found["pixel_accuracy_behind"] <= 1


def test_pieces_stand_on_the_bottom_and_show_their_own_pixels_only():
    image = np.zeros((100, 80, 3), np.uint8)
    piece = np.full((10, 10, 4), 200, np.uint8)
    piece[:5, :, 3] = 0
    shown, hidden = put_in_front(image, [piece] * 3, np.random.default_rng(0))
    assert hidden[-1].any()
    assert not hidden[:49].any()
    assert (shown[hidden] == 200).all()
    assert (shown[~hidden] == 0).all()


def test_a_thing_is_found_where_half_of_its_box_is_hidden():
    labels = np.full((100, 80), FacadeClass.WALL, np.uint8)
    labels[80:] = FacadeClass.SHOP
    possible = (1 << labels).astype(np.uint8)
    facade = LabelledFacade("one", np.zeros((100, 80, 3), np.uint8), labels, possible, *[np.zeros_like(labels)] * 2)
    boxes = {"one": [(0, 90, 20, 100, "car"), (30, 90, 50, 100, "van"), (60, 80, 70, 100, "person")]}

    def hidden(image):
        there = np.zeros(image.shape[:2], bool)
        there[95:, :50] = True
        there[:5, :40] = True
        return there

    figures = in_front.measure_things([facade], boxes, hidden)
    assert figures["recall"] == {"car": [1, 1], "person": [0, 1], "van": [1, 1]}
    assert figures["vehicles"] == [2, 2]
    assert figures["ground_floor"] == round(5 * 50 / (20 * 80), 4)
    assert figures["boxes"] == round(600 / (20 * 80), 4)
    clean = in_front.false_masks([facade], hidden)
    assert clean == {"mean": round(5 * 40 / (80 * 80), 4), "highest": 0.0312, "above_0.05": 0, "images": 1}


def test_a_box_is_measured_by_its_sides():
    from benchmarks import outline

    labels = np.full((100, 80), FacadeClass.WALL, np.uint8)
    beside = np.zeros_like(labels)
    beside[:10], beside[:, :8] = 1, 1
    facade = LabelledFacade(
        "one", np.zeros((100, 80, 3), np.uint8), labels, *np.zeros((2, *labels.shape), np.uint8), beside
    )
    seen = beside.astype(bool)
    seen[:22] = True
    found = outline.measure_boxes([facade], lambda image: seen)
    assert (found["sides"], found["sides_uncut"]) == (0.75, 0.5)
    assert found["facade_lost"] == round(12 / 90, 4)
    assert (found["outside_before"], found["outside_after"]) == (round(1 - 72 * 90 / 8000, 4), 0)
    assert outline.measure_outside([facade], lambda image: seen)["recall"] == 1
