import json

import numpy as np
import pytest

from benchmarks.elements import expected_error, held
from facade_core.core.errors import ModelFileError
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, UNKNOWN, FacadeClass
from facade_core.core.types import Element, Parsing
from facade_core.parsing import confidence as certainty
from facade_core.parsing.confidence import (
    COVERAGE,
    Calibration,
    FacadeStatistics,
    calibrate_elements,
)
from facade_core.parsing.elements import elements
from training.parser.calibration import (
    ParseComparison,
    compare_parse_with_truth,
    fit_calibration,
    mark_matched_elements,
)


def parsed(labels, chance=0.9):
    confidence = np.full((*labels.shape, len(CLASSES)), (1 - chance) / (len(CLASSES) - 1), np.float32)
    np.put_along_axis(confidence, labels[..., None].astype(np.intp), chance, 2)
    return Parsing(labels, confidence, np.zeros(labels.shape, bool))


def facade():
    labels = np.full((100, 80), FacadeClass.WALL, np.uint8)
    labels[20:40, 10:30] = labels[20:40, 50:70] = FacadeClass.WINDOW
    return labels


def possible(truth):
    return np.where(truth < len(CLASSES), 1 << (truth % len(CLASSES)), (1 << len(CLASSES)) - 1).astype(np.uint8)


def photo(found=(), good=(), miss=0.01, doubt=0.1, unseen=0.0):
    """What was observed of a photo whose figures were all missed by as much."""
    every = (FacadeStatistics(*[value] * 3) for value in (miss, doubt, unseen))
    return ParseComparison(list(found), np.array(good, bool), *every)


def doors(*seen):
    return photo([Element("door", 0, 0, 1, 1, confidence) for confidence, _ in seen], [good for _, good in seen])


def test_elements_are_right_once_each():
    true = [Element("window", 0, 0, 10, 10), Element("door", 0, 0, 10, 10)]
    found = [
        Element("window", 1, 0, 10, 10),
        Element("window", 0, 0, 9, 10),
        Element("door", 0, 6, 10, 16),
        Element("shop", 0, 0, 10, 10),
    ]
    good = mark_matched_elements(found, true)
    assert good[:2].sum() == 1
    assert good.tolist()[2:] == [False, False]
    assert mark_matched_elements([], true).shape == (0,)


def test_confidence_is_put_right():
    """A network that says 0.9 of what is right half the time, and 0.99 of what is right nine times of ten."""
    rng = np.random.default_rng(0)
    confidence = rng.choice([0.9, 0.99], 4000)
    good = rng.random(4000) < np.where(confidence == 0.9, 0.5, 0.9)
    windows = [Element("window", 0, 0, 1, 1, value) for value in confidence]
    record = fit_calibration([photo(windows, good)])
    sure = Calibration(
        {name: tuple(line) for name, line in record["elements"].items()}, FacadeStatistics(**record["widths"])
    )
    made = calibrate_elements(windows, sure, np.zeros((2, 2), bool))
    assert sorted({round(one.confidence, 1) for one in made}) == [0.5, 0.9]
    probability = np.array([one.confidence for one in made])
    assert expected_error(probability, good.astype(float)) < 0.02 < expected_error(confidence, good.astype(float))


def test_few_elements_that_were_all_right_are_not_certain():
    record = fit_calibration([doors((0.8, True), (0.9, True))])
    sure = Calibration({"door": tuple(record["elements"]["door"])}, FacadeStatistics(1, 1, 1))
    assert 0.5 < sure.element_probability(Element("door", 0, 0, 1, 1, 0.85)) < 0.95
    assert record["elements"]["shop"] == [1, 0], "of what was not seen the confidence stays"


def test_more_confidence_is_never_less_probability():
    record = fit_calibration([doors((0.95, False), (0.9, False)), doors((0.6, True), (0.5, True))])
    assert record["elements"]["door"][0] >= 0


def test_what_is_made_up_was_seen_by_nobody():
    sure = Calibration({"window": (1.0, 0.0)}, FacadeStatistics(1, 1, 1))
    hidden = np.zeros((40, 40), bool)
    hidden[20:] = True
    seen, half, made_up = calibrate_elements(
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
        width = fit_calibration([photo(miss=m, doubt=d) for m, d in zip(misses[:39], doubt[:39], strict=True)])[
            "widths"
        ]
        held.append(misses[39] <= width["windows"] * doubt[39])
    assert np.mean(held) == pytest.approx(COVERAGE, abs=0.06)


def told(parsing, hidden, widths=(0.5, 5.0, 1.0)):
    return Calibration({}, FacadeStatistics(*widths)).estimate(parsing, elements(parsing), hidden)


def test_what_intervals_hold_is_measured_and_those_of_counts_are_whole():
    misses, halves = np.array([0, 1, 2, 0.0]), np.array([0.5, 1.9, 1.9, 0.0])
    whole = held(misses, halves, 0)
    assert (whole["near"], whole["held_by_90_percent"], whole["mean_half_width"]) == (0.5, 0.75, 0.5)
    share = held(misses / 10, halves / 10, 0.1)
    assert (share["near"], share["held_by_90_percent"], share["mean_half_width"]) == (0.75, 0.75, 0.1075)


def test_the_less_is_seen_the_wider_the_interval():
    nothing = np.zeros(facade().shape, bool)
    value, low, high = told(parsed(facade()), nothing)
    assert value.window_share == 0.1
    assert (value.windows, value.floors) == (2, 2), "a row of windows, and the ground floor"
    hidden = nothing.copy()
    hidden[5:] = True
    sure, unsure = told(parsed(facade(), 0.99), nothing), told(parsed(facade(), 0.99), hidden)
    for name in FacadeStatistics._fields:
        of = [[getattr(end, name) for end in (one.low, one.high)] for one in (sure, unsure)]
        assert of[1][0] <= of[0][0] <= getattr(value, name) <= of[0][1] < of[1][1], name
    assert low.window_share < sure.low.window_share < sure.high.window_share < high.window_share
    bare = parsed(np.full((100, 80), FacadeClass.WALL, np.uint8), 0.99)
    assert told(bare, hidden).high.window_share > 0.04, "where none is seen some may be hidden"
    assert told(bare, hidden).value.floors == 0, "nothing tells"


def test_counts_are_whole_and_a_facade_has_a_storey():
    _, low, high = told(parsed(facade()), np.zeros(facade().shape, bool), (0.5, 100.0, 100.0))
    assert (low.windows, low.floors) == (0, 1)
    assert all(isinstance(value, int) for value in (*low[1:], *high[1:]))
    _, low, high = told(parsed(facade()), np.zeros(facade().shape, bool), (0.5, 0.0, 0.0))
    assert (*low[1:], *high[1:]) == (2, 2, 2, 2)


def test_half_of_the_windows_made_up_may_not_be_there():
    labels = facade()
    labels[60:80, 10:30] = labels[60:80, 50:70] = FacadeClass.WINDOW
    hidden = np.zeros(labels.shape, bool)
    hidden[45:] = True
    value, low, high = told(parsed(labels), hidden, (0, 0, 0))
    assert (low.windows, value.windows, high.windows) == (3, 4, 5)
    hidden[:] = True
    value, low, high = told(parsed(labels), hidden, (0, 0, 0))
    assert (low.floors, value.floors, high.floors) == (1, 2, 3)


def test_what_is_not_labelled_is_not_held_against_a_parse():
    truth = facade()
    truth[:, 40:] = UNKNOWN
    seen = compare_parse_with_truth(parsed(facade()), truth, possible(truth))
    assert [(element.x0, element.x1) for element in seen.found] == [(10, 30)]
    assert seen.is_correct.all()
    assert seen.misses == (0, 0, 0)
    whole = compare_parse_with_truth(parsed(facade()), facade(), possible(facade()))
    assert seen.uncertainty.window_share == pytest.approx(whole.uncertainty.window_share, abs=1e-4), (
        "nor is it unsure of it"
    )
    truth = facade()
    truth[30:] = UNKNOWN
    assert compare_parse_with_truth(parsed(facade()), truth, possible(truth)).found == [], (
        "half of each is not labelled: it cannot be compared"
    )


def test_windows_behind_blinds_are_counted_once_and_storeys_without_windows_too():
    truth = facade()
    truth[20:30, 10:30] = truth[34:40, 10:30] = UNKNOWN  # a window seen through a slit
    maybe = possible(truth)
    maybe[truth == UNKNOWN] = 1 << FacadeClass.WINDOW | 1 << FacadeClass.WALL
    assert compare_parse_with_truth(parsed(facade()), truth, maybe).misses.windows == 0
    missed = facade()
    missed[20:40, 50:70] = FacadeClass.WALL
    assert compare_parse_with_truth(parsed(missed), truth, maybe).misses.windows == 1
    truth = facade()[:55]
    assert compare_parse_with_truth(parsed(facade()[:55]), truth, possible(truth)).misses.floors == 0
    truth = facade()
    truth[70:, 30:50] = FacadeClass.DOOR
    assert compare_parse_with_truth(parsed(facade()), truth, possible(truth)).misses.floors == 0


def test_what_hides_windows_is_not_held_against_a_parse_either():
    labels = facade()
    labels[60:80, 10:30] = labels[60:80, 50:70] = FacadeClass.WINDOW
    parsing = parsed(labels)
    parsing.occluded[:, 40:] = True
    truth = labels.copy()
    truth[60:80, 50:70] = FacadeClass.WALL
    seen = compare_parse_with_truth(parsing, truth, possible(truth))
    assert (seen.misses.windows, seen.hidden_part.windows) == (1, pytest.approx(1))
    assert fit_calibration([seen])["widths"]["windows"] == 0


def test_a_model_that_says_nothing_of_it_is_refused(tmp_path):
    path = tmp_path / "own.onnx"
    path.write_bytes(b"")
    path.with_suffix(".json").write_text(json.dumps({"classes": list(CLASSES)}))
    with pytest.raises(ModelFileError, match=r"own.onnx: .*how sure.*train it anew"):
        certainty.load_calibration(path)
    lines = {name: [1, 0] for name in ELEMENT_CLASSES}
    for known in (lines, {"door": [1, 0]}):
        record = {
            "classes": list(CLASSES),
            "certainty": {"elements": known, "widths": dict.fromkeys(FacadeStatistics._fields, 20)},
        }
        path.with_suffix(".json").write_text(json.dumps(record) + " " * len(known))
        if known is lines:
            assert certainty.load_calibration(path) == Calibration(
                {name: (1.0, 0.0) for name in lines}, FacadeStatistics(20, 20, 20)
            )
        else:
            with pytest.raises(ModelFileError, match="how sure"):
                certainty.load_calibration(path)
