import json

import numpy as np
import pytest

from benchmarks.elements import expected_error
from facade_core.errors import ModelError
from facade_core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, WALL, WINDOW
from facade_core.parse import certainty
from facade_core.parse.certainty import COVERAGE, Certainty, observed, right, with_probabilities
from facade_core.types import Element, Parsing


def parsed(labels, chance=0.9):
    confidence = np.full((*labels.shape, len(CLASSES)), (1 - chance) / (len(CLASSES) - 1), np.float32)
    np.put_along_axis(confidence, labels[..., None].astype(np.intp), chance, 2)
    return Parsing(labels, confidence, np.zeros(labels.shape, bool))


def facade():
    labels = np.full((100, 80), WALL, np.uint8)
    labels[20:40, 10:30] = labels[20:40, 50:70] = WINDOW
    return labels


def test_elements_are_right_once_each():
    true = [Element("window", 0, 0, 10, 10), Element("door", 0, 0, 10, 10)]
    found = [
        Element("window", 1, 0, 10, 10),
        Element("window", 0, 0, 9, 10),
        Element("door", 0, 6, 10, 16),
        Element("shop", 0, 0, 10, 10),
    ]
    good = right(found, true)
    assert good[:2].sum() == 1
    assert good.tolist()[2:] == [False, False]
    assert right([], true).shape == (0,)


def test_confidence_is_put_right():
    """A network that says 0.9 of what is right half the time, and 0.99 of what is right nine times of ten."""
    rng = np.random.default_rng(0)
    confidence = rng.choice([0.9, 0.99], 4000)
    good = rng.random(4000) < np.where(confidence == 0.9, 0.5, 0.9)
    record = certainty.fit({"window": list(zip(confidence, good, strict=True))}, [(0.01, 0.1)])
    sure = Certainty({name: tuple(line) for name, line in record["elements"].items()}, record["width"])
    made = with_probabilities(
        [Element("window", 0, 0, 1, 1, value) for value in confidence], sure, np.zeros((2, 2), bool)
    )
    assert sorted({round(one.confidence, 1) for one in made}) == [0.5, 0.9]
    probability = np.array([one.confidence for one in made])
    assert expected_error(probability, good.astype(float)) < 0.02 < expected_error(confidence, good.astype(float))


def test_few_elements_that_were_all_right_are_not_certain():
    record = certainty.fit({"door": [(0.8, True), (0.9, True)]}, [(0.01, 0.1)])
    sure = Certainty({"door": tuple(record["elements"]["door"])}, 1.0)
    assert 0.5 < sure.probability(Element("door", 0, 0, 1, 1, 0.85)) < 0.95
    assert record["elements"]["shop"] == [1, 0], "of what was not seen the confidence stays"


def test_more_confidence_is_never_less_probability():
    record = certainty.fit({"door": [(0.95, False), (0.9, False), (0.6, True), (0.5, True)]}, [(0.01, 0.1)])
    assert record["elements"]["door"][0] >= 0


def test_what_is_made_up_was_seen_by_nobody():
    sure = Certainty({"window": (1.0, 0.0)}, 1.0)
    hidden = np.zeros((40, 40), bool)
    hidden[20:] = True
    seen, half, made_up = with_probabilities(
        [Element("window", 0, y, 10, y + 10, 0.8) for y in (0, 15, 30)], sure, hidden
    )
    assert (seen.confidence, half.confidence, made_up.confidence) == pytest.approx((0.8, 0.4, 0.0))


def test_intervals_hold_what_they_promise():
    """By misses of which none is like another: new ones of the same kind are held as often as was asked for."""
    rng = np.random.default_rng(1)
    held = []
    for _ in range(200):
        doubt = rng.uniform(0.01, 0.1, 40)
        misses = np.abs(rng.normal(0, doubt))
        width = certainty.fit({}, list(zip(misses[:39], doubt[:39], strict=True)))["width"]
        held.append(misses[39] <= width * doubt[39])
    assert np.mean(held) == pytest.approx(COVERAGE, abs=0.06)


def test_the_less_is_seen_the_wider_the_interval():
    parsing, sure = parsed(facade()), Certainty({}, 0.5)
    nothing = np.zeros(parsing.labels.shape, bool)
    share, low, high = sure.window_share(parsing, nothing)
    assert share == 0.1
    assert low < share < high
    hidden = nothing.copy()
    hidden[50:] = True
    _, lower, higher = sure.window_share(parsed(facade(), 0.99), nothing)
    assert low < lower
    assert higher < high
    _, low, high = sure.window_share(parsed(facade(), 0.99), hidden)
    assert low < lower
    assert higher < high
    bare = parsed(np.full((100, 80), WALL, np.uint8), 0.99)
    assert sure.window_share(bare, hidden)[2] > 0.04, "where none is seen some may be hidden"


def test_what_is_not_labelled_is_not_held_against_a_parse():
    truth = facade()
    truth[:, 40:] = UNKNOWN
    found, good, miss, doubt = observed(parsed(facade()), truth)
    assert [(element.x0, element.x1) for element in found] == [(10, 30)]
    assert good.all()
    assert miss == 0
    assert doubt == pytest.approx(observed(parsed(facade()), facade())[3], abs=1e-4), "nor is it unsure of it"
    truth = facade()
    truth[30:] = UNKNOWN
    assert observed(parsed(facade()), truth)[0] == [], "half of each is not labelled: it cannot be compared"


def test_a_model_that_says_nothing_of_it_is_refused(tmp_path):
    path = tmp_path / "own.onnx"
    path.write_bytes(b"")
    path.with_suffix(".json").write_text(json.dumps({"classes": list(CLASSES)}))
    with pytest.raises(ModelError, match=r"own.onnx: .*how sure.*train it anew"):
        certainty.certainty(path)
    lines = {name: [1, 0] for name in ELEMENT_CLASSES}
    for elements in (lines, {"door": [1, 0]}):
        record = {"classes": list(CLASSES), "certainty": {"elements": elements, "width": 20}}
        path.with_suffix(".json").write_text(json.dumps(record) + " " * len(elements))
        if elements is lines:
            assert certainty.certainty(path) == Certainty({name: (1.0, 0.0) for name in lines}, 20.0)
        else:
            with pytest.raises(ModelError, match="how sure"):
                certainty.certainty(path)
