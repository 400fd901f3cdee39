import itertools

import numpy as np
import pytest

from facade_core.core.errors import LayoutError, ModelFileError
from facade_core.core.labels import CLASSES
from facade_core.core.types import Element, Parsing
from facade_core.facade.layout import completion
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.floor_hypotheses import extrapolate_floors
from facade_core.facade.layout.gap_filling import find_fillers_and_strays, remove_lone_balconies
from facade_core.facade.layout.grids import box_array, fit_grids
from facade_core.facade.layout.model import default_layout_model
from facade_core.facade.layout.proposals import Proposals, propose_elements
from facade_core.facade.layout.rectangles import pairwise_iou
from facade_core.facade.layout.shop_floor import select_shop_row
from facade_core.facade.layout.window_rows import RowLimits, find_missing_windows, min_window_gap
from training.layout.learning import log_floor_progressions

DOMAIN = (0.0, 0.0, 200.0, 160.0)
LEFT = [(0.0, 0.0, 100.0, 160.0)]


def box(label, cx, cy, w, h):
    return Element(label, cx - w / 2, cy - h / 2, cx + w / 2, cy + h / 2)


def facade():
    """Windows 5 x 3 with balconies on the middle floor, and the door."""
    windows = [box("window", x, y, 16, 24) for y in (30, 70, 110) for x in (20, 60, 100, 140, 180)]
    balconies = [box("balcony", x, 80, 24, 8) for x in (20, 60, 100, 140, 180)]
    return [*windows, *balconies, box("door", 60, 148, 16, 24)]


def see(elements, region):
    def meets(e):
        return any(min(e.x1, r[2]) > max(e.x0, r[0]) and min(e.y1, r[3]) > max(e.y0, r[1]) for r in region)

    return [e for e in elements if meets(e)]


def overlapping(a, b):
    return min(a.x1, b.x1) > max(a.x0, b.x0) and min(a.y1, b.y1) > max(a.y0, b.y0)


def sound(completion, seen, domain, region):
    elements = completion.elements
    assert elements[: len(seen)] == tuple(seen)
    for i, e in enumerate(elements[len(seen) :], len(seen)):
        assert e.x0 >= domain[0]
        assert e.y0 >= domain[1]
        assert e.x1 <= domain[2]
        assert e.y1 <= domain[3]
        assert not any(overlapping(e, Element("", *r)) for r in region)
        assert not any(overlapping(e, o) for o in elements[:i] if {o.label, e.label} != {"window", "balcony"})


def test_hidden_right_half_of_a_regular_facade_is_found():
    seen = see(facade(), LEFT)
    (best,) = complete(seen, DOMAIN, LEFT)
    sound(best, seen, DOMAIN, LEFT)
    truth = {e for e in facade() if e not in seen and e.label != "door"}
    proposed = {e for e in best.elements[len(seen) :] if e.label != "door"}
    rounded = {(e.label, *np.round((e.x0, e.y0, e.x1, e.y1), 3)) for e in proposed}
    expected = {(e.label, e.x0, e.y0, e.x1, e.y1) for e in truth}
    assert expected <= rounded
    assert all(label == "window" and y0 > 122 for label, _, y0, *_ in rounded - expected), (
        "the ground floor may have more"
    )


@pytest.mark.parametrize(("columns", "floors", "axis"), [(40, 4, 0), (30, 12, 0), (10, 16, 1), (10, 24, 1)])
def test_a_regular_grid_half_hidden_is_found_whole(columns, floors, axis):
    whole = [box("window", 30 * x + 15, 40 * y + 20, 12, 22) for y in range(floors) for x in range(columns)]
    domain = (0.0, 0.0, 30.0 * columns, 40.0 * floors)
    region = [tuple(side / 2 if k == axis + 2 else side for k, side in enumerate(domain))]
    seen = see(whole, region)
    (best,) = complete(seen, domain, region)
    sound(best, seen, domain, region)
    assert {(e.x0, e.y0) for e in best.elements} == {(e.x0, e.y0) for e in whole}


@pytest.mark.long
def test_a_tiny_spacing_in_a_large_domain_is_carried_on_so_far_only():
    seen = [box("window", x, y, 2, 3) for x in (11, 15) for y in (11, 21)]
    domain = (0.0, 0.0, 1e6, 1e6)
    (best,) = complete(seen, domain, [(0.0, 0.0, 20.0, 30.0)])
    assert len(best.elements) < 2000


def test_no_door_is_added_beside_the_one_that_is_seen_but_one():
    seen = see(facade(), LEFT)
    for option in complete(seen, DOMAIN, LEFT, n=5):
        assert sum(e.label == "door" for e in option.elements) <= 2


def test_floors_that_grow_downwards_are_proposed():
    floors, heights = np.array([60.0, 120.0]), np.array([30.0, 30.0])
    below = extrapolate_floors(floors, heights, np.array([1.2, 1.1, 1.5, 1.3]), 40, 400)
    np.testing.assert_allclose(below, [(192, 45), (258, 39), (324, 39)])
    (grown,) = log_floor_progressions(np.array([0.0, 10, 22, 33]), np.array([5.0, 5, 10, 8]))[:1]
    np.testing.assert_allclose(np.exp(grown), (1.2, 1.1, 2.0, 1.6))
    whole = [box("window", 40 * x + 20, 40 + y, 16, 30) for y in (60, 121, 184, 250, 319, 392) for x in range(6)]
    domain, region = (0.0, 0.0, 240.0, 500.0), [(0.0, 0.0, 240.0, 250.0)]
    seen = see(whole, region)
    found = propose_elements(seen, fit_grids(seen), domain, np.array(region), default_layout_model().priors)
    hidden = box_array([e for e in whole if e not in seen])
    assert pairwise_iou(hidden, found.box[found.label == 0]).max(axis=1).min() > 0.5


def test_a_front_has_a_door_however_unlikely():
    region = [(0.0, 0.0, 200.0, 90.0)]
    seen = see([e for e in facade() if e.label == "window"], region)
    (best,) = complete(seen, DOMAIN, region, front=True)
    sound(best, seen, DOMAIN, region)
    (door,) = (e for e in best.elements if e.label == "door")
    assert door.y1 > 150
    assert 0 < door.confidence < 0.5
    shown = [*facade()[:10], facade()[-1]]
    (best,) = complete(shown, DOMAIN, [*region, (50.0, 130.0, 70.0, 160.0)], front=True)
    assert sum(e.label == "door" for e in best.elements) == 1, "one that is seen is enough"


def test_a_door_is_where_the_map_has_it():
    region = [(0.0, 0.0, 200.0, 125.0)]
    seen = [e for e in facade() if e.label != "door"]
    for place in (33.0, 120.0):
        (best,) = complete(seen, DOMAIN, region, entrances=(place,), front=True)
        sound(best, seen, DOMAIN, region)
        (door,) = (e for e in best.elements if e.label == "door")
        assert (door.x0 + door.x1) / 2 == pytest.approx(place, abs=2)
        assert door.confidence >= 0.9


def test_rows_are_full_and_nothing_stands_alone_in_one():
    found = Proposals(
        np.array([(30 * c, 40 * r, 30 * c + 12, 40 * r + 22) for r in range(4) for c in range(6)], float),
        np.zeros(24, np.int8),
        np.ones((24, 1), np.float32),
    )
    kept = np.array([k for k in range(18) if k != 3] + [20])  # a gap in the first row, one window in the last
    fill, alone = find_fillers_and_strays(found, kept, np.full(24, 0.2), [], np.zeros((0, 4)))
    assert np.flatnonzero(fill).tolist() == [3]
    assert np.flatnonzero(alone).tolist() == [20]
    fill, _ = find_fillers_and_strays(found, kept, np.where(np.arange(24) == 3, 0.0, 0.2), [], np.zeros((0, 4)))
    assert not fill.any(), "what the picture denies"


def test_an_unlikely_balcony_without_a_window_is_removed():
    window, seen = Element("window", 10, 10, 20, 24, 0.5), Element("window", 40, 10, 50, 24)
    balconies = [Element("balcony", x, 20, x + 14, 27, p) for x, p in ((8, 0.2), (38, 0.2), (70, 0.3), (90, 0.5))]
    kept = remove_lone_balconies([window, *balconies], [seen])
    assert kept == (window, *balconies[:2], balconies[3])


def guesses(corners, label):
    return Proposals(np.array(corners, float), np.array(label, np.int8), np.ones((len(corners), 1), np.float32))


def test_a_row_goes_on_in_the_rhythm_of_the_one_beside_it_and_no_floor_is_left_out():
    across = (0, 16, 60, 76, 120, 136)  # pairs
    found = guesses([(x, y, x + 12, y + 22) for y in (0, 40, 80) for x in across], [0] * 18)
    things = [Element("window", x, 0, x + 12, 22) for x in across[:2]]
    apart = min_window_gap(things)
    assert apart == pytest.approx(2.4), "three fifths of what is between the two, or less"
    kept, likely = np.array([2, 3, 4, 5, 6, 8, 11]), np.full(18, 0.2)
    clear = ~np.isin(np.arange(18), (0, 1))
    limits = RowLimits(apart, 0.1, 0.1)
    fill = find_missing_windows(found, kept, likely, things, clear, limits)
    assert np.flatnonzero(fill).tolist() == [7, 9, 10, *range(12, 18)]
    fill = find_missing_windows(found, kept, likely, things, clear, RowLimits(apart, 0.1, 0.3))
    assert np.flatnonzero(fill).tolist() == [7, 9, 10], "the ground floor is too unlikely"
    denied = np.where(np.arange(18) == 9, 0.0, likely)
    assert not find_missing_windows(found, kept, denied, things, clear, limits)[9], "what the picture denies"


def test_windows_keep_their_distance():
    seen = [box("window", x, y, 16, 24) for y in (30, 70, 110) for x in (20, 60)]
    (best,) = complete(seen, DOMAIN, [(0.0, 0.0, 90.0, 160.0)])
    rows = {}
    for e in best.elements:
        if e.label == "window":
            rows.setdefault(round(e.y0), []).append(e)
    gaps = [b.x0 - a.x1 for row in rows.values() for a, b in itertools.pairwise(sorted(row, key=lambda e: e.x0))]
    assert min(gaps) >= min_window_gap(seen) == pytest.approx(3.2)


def test_shops_of_a_ground_floor_are_of_one_size_and_there_all_or_none():
    corners = [(x, 0, x + w, 30) for w in (20, 45) for x in (0, 25, 50, 75)]
    found = guesses(corners, [3] * 8)
    likely = np.array([0.1, 0.5, 0.1, 0.1, 0.3, 0.0, 0.3, 0.0])
    clear = np.ones(8, bool)
    assert sorted(select_shop_row(found, likely, clear, 0.1)) == [0, 1, 2, 3]
    assert sorted(select_shop_row(found, likely, np.arange(8) != 1, 0.1)) == [4, 6]
    shop = [box("shop", x, 145, 26, 30) for x in (20, 60, 100, 140, 180)]
    upper = [e for e in facade() if e.label == "window" and e.y1 < 100]
    seen = see([*upper, *shop], LEFT)
    layouts = complete(seen, DOMAIN, LEFT, n=5)
    assert {sum(e.label == "shop" for e in layout.elements[len(seen) :]) for layout in layouts} <= {0, 2}
    assert sum(e.label == "shop" for e in layouts[0].elements[len(seen) :]) == 2
    assert len({(e.width, e.y0, e.y1) for e in layouts[0].elements if e.label == "shop"}) == 1


def test_hidden_top_floor_is_found():
    region = [(0.0, 50.0, 200.0, 160.0)]
    seen = see(facade(), region)
    (best,) = complete(seen, DOMAIN, region)
    sound(best, seen, DOMAIN, region)
    assert {(e.x0, e.y0) for e in best.elements[len(seen) :]} == {(x - 8, 18) for x in (20, 60, 100, 140, 180)}


def test_alternatives_are_distinct_ranked_and_sound():
    seen = see(facade(), LEFT)
    options = complete(seen, DOMAIN, LEFT, n=3)
    assert 2 <= len({frozenset(c.elements) for c in options}) == len(options) <= 3
    assert [c.score for c in options] == sorted((c.score for c in options), reverse=True)
    for option in options:
        sound(option, seen, DOMAIN, LEFT)
    assert options == complete(seen, DOMAIN, LEFT, n=3)


@pytest.mark.parametrize(("columns", "floors"), [(6, 5), (5, 4)])
def test_no_alternative_completes_nothing(columns, floors):
    seen = [box("window", 10 + 20 * i, 10 + 30 * j, 10, 16) for i in range(columns // 2) for j in range(floors)]
    domain, region = (0.0, 0.0, 20.0 * columns, 30.0 * floors), [(0.0, 0.0, 10.0 * columns, 30.0 * floors)]
    options = complete(seen, domain, region, n=5)
    assert min(len(option.elements) for option in options) > len(seen)


def test_random_regions_stay_sound():
    rng = np.random.default_rng(3)
    for _ in range(20):
        x, y = rng.uniform(20, 150), rng.uniform(20, 120)
        region = [(0.0, 0.0, x, 160.0), (x, y, 200.0, 160.0)]
        seen = see(facade(), region)
        for option in complete(seen, DOMAIN, region, n=5):
            sound(option, seen, DOMAIN, region)


def test_doors_stay_on_the_ground_line():
    seen = see(facade(), LEFT)
    for option in complete(seen, DOMAIN, LEFT, n=8):
        assert {(e.y0, e.y1) for e in option.elements if e.label == "door"} == {(136, 160)}


def test_nothing_is_added_when_all_is_seen():
    (best,) = complete(facade(), DOMAIN, [DOMAIN], n=3)
    assert best.elements == tuple(facade())


def test_one_element_is_completed_soundly():
    lone = box("window", 40, 70, 16, 24)
    for option in complete([lone], DOMAIN, LEFT, n=3):
        sound(option, [lone], DOMAIN, LEFT)


def test_a_blank_wall_becomes_a_whole_facade():
    options = complete([], DOMAIN, [], n=3)
    assert len({c.elements for c in options}) == 3
    for option in options:
        sound(option, [], DOMAIN, [])
        assert sum(e.label == "window" for e in option.elements) >= 4
    metres = complete([], (0.0, 0.0, 12.0, 13.0), [])[0].elements
    assert 3 <= len({round(e.y0, 6) for e in metres if e.label == "window"}) <= 4


def test_labels_that_are_no_elements_are_kept():
    seen = [*see(facade(), LEFT), Element("roof", 0, 0, 200, 15)]
    (best,) = complete(seen, DOMAIN, LEFT)
    sound(best, seen, DOMAIN, LEFT)


def test_evidence_decides_at_the_border_of_a_hole():
    region = [(0.0, 0.0, 120.0, 160.0)]
    seen = see(facade(), region)
    confidence = np.zeros((160, 200, len(CLASSES)), np.float32)
    occluded = np.ones((160, 200), bool)
    occluded[:, :120] = occluded[18:42, 125:150] = False  # one hidden window shows
    confidence[..., 0] = 1
    bare = complete(seen, DOMAIN, region, evidence=Parsing(np.zeros((160, 200), np.uint8), confidence, occluded))[0]
    there = box("window", 140, 30, 16, 24)
    assert not any(overlapping(e, there) for e in bare.elements if e.label == "window")
    confidence[18:42, 125:150] = 0
    confidence[18:42, 132:148, 1] = 1
    shown = complete(seen, DOMAIN, region, evidence=Parsing(np.zeros((160, 200), np.uint8), confidence, occluded))[0]
    assert any(overlapping(e, there) for e in shown.elements if e.label == "window")


def test_evidence_without_confidence_is_refused():
    flat = Parsing(np.zeros((4, 4), np.uint8), np.zeros((4, 4), np.float32), np.zeros((4, 4), bool))
    with pytest.raises(LayoutError, match="evidence"):
        complete(see(facade(), LEFT), DOMAIN, LEFT, evidence=flat)


def test_bare_wall_and_duplicates():
    assert complete([], DOMAIN, LEFT)[0].elements == ()
    seen = see(facade(), LEFT)
    assert complete([*seen, seen[0]], DOMAIN, LEFT) == complete(seen, DOMAIN, LEFT)


@pytest.mark.parametrize(
    ("observed", "domain", "region", "message"),
    [
        ([Element("window", 300, 10, 310, 20)], DOMAIN, [DOMAIN], "outside the domain"),
        ([Element("window", 10, 10, 10, 20)], DOMAIN, [DOMAIN], "no area"),
        ([Element("gate", 10, 10, 20, 20)], DOMAIN, [DOMAIN], "unknown label"),
        ([Element("window", 150, 10, 160, 20)], DOMAIN, LEFT, "outside the observed region"),
        ([Element("window", 10, 10, 20, 20)], DOMAIN, [], "empty though"),
        ([], DOMAIN, [(5, 5, 5, 9)], "needs an area"),
        ([], DOMAIN, [(500, 5, 510, 9)], "needs an area"),
        ([], (0, 0, 0, 10), [DOMAIN], "domain"),
    ],
)
def test_bad_input(observed, domain, region, message):
    with pytest.raises(LayoutError, match=message):
        complete(observed, domain, region)


def test_model_and_n_are_checked():
    with pytest.raises(ModelFileError, match="LayoutModel"):
        complete([], DOMAIN, LEFT, model=object())
    with pytest.raises(LayoutError, match="n must be"):
        complete([], DOMAIN, LEFT, n=0)


@pytest.mark.long
def test_hidden_halves_of_real_facades(data):
    from benchmarks.layout import held_out
    from benchmarks.layout.baselines import median_pitch, ours
    from benchmarks.layout.figures import run

    records = held_out(data / "layouts" / "cmp.jsonl", default_layout_model())[::4]
    report, plain = (run(records, method) for method in (ours(default_layout_model(), 1), median_pitch))
    assert report["all"]["f1@0.5"] >= 1.2 * plain["all"]["f1@0.5"]
    for kind in ("right", "lower", "region", "sparse"):
        assert report[kind]["overlaps"] == report[kind]["outside"] == 0


@pytest.mark.long
def test_a_parse_of_the_finished_picture_finds_the_completed_layout():
    from benchmarks.layout import painted

    made = painted((("brick", 5), ("haussmann", 7), ("jugend", 7)))
    assert made["found again"]["all"] >= 0.9
    assert made["found again"]["touched by a hole"] >= 0.85


def test_doubt_leaves_a_hidden_middle_less_empty_than_other_hidden_parts(monkeypatch):
    region = [(0.0, 0.0, 60.0, 160.0), (140.0, 0.0, 200.0, 160.0)]

    def propose(seed):
        random = np.random.default_rng(seed)
        places = [random.uniform(10, 50), random.uniform(150, 190)]
        seen = [box("window", x, y + random.normal(0, 2), 12, 20) for y in (30, 75, 120) for x in places]
        return len(complete(seen, DOMAIN, region)[0].elements)

    found = sum(map(propose, range(6)))
    monkeypatch.setattr(completion, "is_middle_hidden", lambda *_: False)
    assert found > sum(map(propose, range(6)))
