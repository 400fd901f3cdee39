import dataclasses

import numpy as np
import pytest

from facade_core.core.errors import LayoutError
from facade_core.core.types import Element
from facade_core.facade.layout.densities import (
    MIN_LOG_DENSITY,
    TERMS,
    log_conditional_density,
    log_density,
)
from facade_core.facade.layout.model import default_layout_model
from facade_core.facade.layout.scores import layout_score_terms, measure_layout_from_elements, score
from facade_core.facade.layout.statistics import (
    ALIGN_Y,
    COMPLETE,
    COVERAGE,
    DOOR_AT,
    PATTERN,
    PATTERNS,
    REGULAR_X,
    SYMMETRY,
    WIDTH_RATIO,
)
from training.layout.learning import fit_mixture

DOMAIN = (0.0, 0.0, 200.0, 160.0)


def window(cx, cy, w=16.0, h=24.0, label="window"):
    return Element(label, cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2)


def block(xs=(20, 60, 100, 140, 180), ys=(30, 70, 110)):
    return [window(x, y) for y in ys for x in xs]


def test_statistics_of_a_regular_grid():
    unary, pairs, overall = measure_layout_from_elements([*block(), window(100, 148, label="door")], DOMAIN)
    assert unary[0, WIDTH_RATIO] == pytest.approx(16 / 40)
    assert unary[0, REGULAR_X] == 0
    assert unary[0, COMPLETE] == 1
    assert pairs[0, ALIGN_Y] == 1  # the door stands under a column
    assert overall[SYMMETRY] == 1
    assert overall[DOOR_AT] == 0.5
    assert overall[COVERAGE] == pytest.approx((176 * 104 + 16 * 24) / (200 * 160))


def test_a_missing_cell_and_a_shifted_column_are_seen():
    missing = block()[:7] + block()[8:]
    assert measure_layout_from_elements(missing, DOMAIN)[0][0, COMPLETE] == pytest.approx(14 / 15)
    shifted = block(xs=(20, 60, 100, 150, 180))
    assert measure_layout_from_elements(shifted, DOMAIN)[0][0, REGULAR_X] > 0.03


def test_interleaved_grids_have_a_pattern():
    layout = block(xs=(20, 60, 100), ys=(20, 80)) + [window(x, y) for x in (40, 80) for y in (50, 110)]
    pairs = measure_layout_from_elements(layout, DOMAIN)[1]
    assert PATTERNS[int(pairs[0, PATTERN])] == "AB"


@pytest.mark.parametrize(
    ("order", "name"),
    [("ABAB", "AB"), ("AABAAB", "AAB"), ("AABBAABB", "AABB"), ("ABA", "ABA"), ("AAABAAA", "other"), ("AAABBB", None)],
)
def test_patterns_of_lines_that_take_turns(order, name):
    layout = []
    for k, grid in enumerate(order):  # one grid a little lower than the other, so that their boxes cut
        at = 8 + 176 * k / (len(order) - 1)
        layout += [window(at, y + (20 if grid == "B" else 0), w=10 if grid == "A" else 6, h=10) for y in (30, 70, 110)]
    pattern = measure_layout_from_elements(layout, DOMAIN)[1][0, PATTERN]
    assert (None if np.isnan(pattern) else PATTERNS[int(pattern)]) == name


def test_lines_that_coincide_take_no_turns():
    balconies = [window(x + 0.5 * (-1) ** k, 38, w=20, h=6, label="balcony") for k, x in enumerate((20, 60, 100))]
    pairs = measure_layout_from_elements([*block(xs=(20, 60, 100), ys=(30,)), *balconies], DOMAIN)[1]
    assert np.isnan(pairs[0, PATTERN])


def test_a_door_on_the_third_floor_speaks_against_a_layout():
    usual = [*block(ys=(30, 70, 110)), window(100, 148, label="door")]
    model = default_layout_model()
    compatible = layout_score_terms(usual, DOMAIN, model)[TERMS.index("ec")]
    assert (
        layout_score_terms([*usual, window(40, 50, label="door")], DOMAIN, model)[TERMS.index("ec")] < compatible == 0
    )


def test_elements_one_in_another_have_a_score():
    assert np.isfinite(score([window(100, 80, w=0.1 * k, h=0.1 * k) for k in range(1, 1201, 12)], DOMAIN))


def test_score_does_not_depend_on_order_and_counts_duplicates_once():
    layout = [*block(), window(100, 148, label="door"), window(60, 148, label="door")]
    shuffled = [layout[k] for k in np.random.default_rng(0).permutation(len(layout))]
    assert score(layout, DOMAIN) == score(shuffled, DOMAIN) == score([*layout, layout[0]], DOMAIN)


def test_score_does_not_depend_on_the_unit():
    big = [Element(e.label, *(3 * v for v in (e.x0, e.y0, e.x1, e.y1))) for e in block()]
    assert score(big, tuple(3 * v for v in DOMAIN)) == pytest.approx(score(block(), DOMAIN))


def test_a_regular_layout_scores_higher_than_disturbed_ones_on_average():
    rng = np.random.default_rng(1)
    disturbed = [[window(e.x0 + 8 + rng.normal() * 7, e.y0 + 12 + rng.normal() * 4) for e in block()] for _ in range(8)]
    assert score(block(), DOMAIN) > np.mean([score(layout, DOMAIN) for layout in disturbed])


def test_real_layouts_score_higher_than_the_same_disturbed(data):
    from training.datasets.layouts import read_layouts, split_layouts_for_training

    records = split_layouts_for_training(list(read_layouts(data / "layouts" / "cmp.jsonl")))[1][::3]
    higher = []
    for number, record in enumerate(records):
        shift = np.random.default_rng(number).normal(size=(len(record.elements), 2)) * 0.3
        x0, y0, x1, y1 = record.domain
        disturbed = []
        for e, (dx, dy) in zip(record.elements, shift * [[e.width, e.height] for e in record.elements], strict=True):
            moved = Element(e.label, e.x0 + dx, e.y0 + dy, e.x1 + dx, e.y1 + dy)
            if x0 <= (moved.x0 + moved.x1) / 2 <= x1 and y0 <= (moved.y0 + moved.y1) / 2 <= y1:
                disturbed.append(moved)
        higher.append(score(record.elements, record.domain) > score(disturbed, record.domain))
    assert np.mean(higher) >= 0.85


def test_score_is_the_weighted_sum_of_its_terms():
    model = default_layout_model()
    assert score(block(), DOMAIN) == pytest.approx(float(model.weights @ layout_score_terms(block(), DOMAIN, model)))
    only = dataclasses.replace(model, weights=np.eye(len(TERMS))[0])
    assert score(block(), DOMAIN, model=only) == pytest.approx(layout_score_terms(block(), DOMAIN, model)[0])


def test_every_term_is_floored():
    strange = [window(100, 80, w=199, h=0.5)]
    assert (layout_score_terms(strange, DOMAIN, default_layout_model()) >= 4 * MIN_LOG_DENSITY - 1e-9).all()
    assert np.isfinite(score([], DOMAIN))


@pytest.mark.parametrize(
    ("elements", "domain", "message"),
    [
        ([window(300, 10)], DOMAIN, "outside the domain"),
        ([window(30, 10, w=0)], DOMAIN, "no area"),
        ([window(30, 10, label="gate")], DOMAIN, "unknown label"),
        ([], (0, 0, 0, 10), "domain"),
        ([], (0, 0, float("nan"), 10), "domain"),
    ],
)
def test_bad_input(elements, domain, message):
    with pytest.raises(LayoutError, match=message):
        score(elements, domain)


def test_bic_finds_two_components_and_the_density_integrates_to_one():
    rng = np.random.default_rng(2)
    mixture = fit_mixture(np.concatenate([rng.normal(0, 0.2, 300), rng.normal(3, 0.3, 300)]), 0)
    assert (mixture[:, 0] > 0).sum() == 2
    xs = np.linspace(-3, 6, 2000)
    total = sum(np.exp(log_density(x, mixture)) for x in xs) * (xs[1] - xs[0])
    assert total == pytest.approx(1, abs=0.02)


def test_conditional_density_follows_its_condition():
    rng = np.random.default_rng(3)
    near, far = rng.normal((1, 0), 0.1, (200, 2)), rng.normal((0, 1), 0.1, (200, 2))
    mixture = fit_mixture(np.concatenate([near, far]), 0)
    assert log_conditional_density(1.0, 0.0, mixture) > log_conditional_density(1.0, 1.0, mixture) + 2
