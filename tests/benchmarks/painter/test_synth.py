"""The painter keeps its promises: truth that fits the picture, exact occlusion, the same bits every time."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest

from benchmarks.painter.exemplars import paint_exemplar_set
from benchmarks.painter.facade import PaintedFacade, paint_facade
from benchmarks.painter.shops import design_shops
from benchmarks.painter.styles import STYLES
from facade_core.core.errors import FacadeError
from facade_core.core.labels import CLASSES, ELEMENT_CLASSES, FacadeClass


def paint(style: str = "jugend", **changes) -> PaintedFacade:
    arguments = dict(floors=4, columns=4, style=style, metres_per_pixel=0.08, seed=5)
    size = changes.pop("size_m", (15.0, 12.0))
    return paint_facade(size, **(arguments | changes))


@pytest.fixture(scope="module", params=STYLES)
def painted(request) -> PaintedFacade:
    return paint(request.param)


def test_shapes_and_counts(painted):
    assert painted.image.shape == (188, 150, 3)
    assert painted.image.dtype == np.uint8
    assert painted.labels.shape == painted.occluded.shape == (188, 150)
    assert painted.labels.dtype == np.uint8
    assert painted.occluded.dtype == bool
    assert not painted.occluded.any()
    assert (painted.floors, painted.columns, painted.metres_per_pixel) == (4, 4, 0.08)
    assert len(painted.elements) == len(painted.element_states)


def test_labels_are_the_elements_drawn_in_class_order(painted):
    expected = np.where(painted.labels == FacadeClass.ROOF, FacadeClass.ROOF, FacadeClass.WALL).astype(np.uint8)
    for name in ELEMENT_CLASSES:
        for e in painted.elements:
            if e.label == name:
                expected[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] = CLASSES.index(name)
    np.testing.assert_array_equal(painted.labels, expected)
    assert not (painted.labels == FacadeClass.SKY).any()


def test_elements_lie_inside_on_whole_pixels(painted):
    height, width = painted.labels.shape
    for e in painted.elements:
        assert all(v == int(v) for v in (e.x0, e.y0, e.x1, e.y1))
        assert 0 <= e.x0 < e.x1 <= width
        assert 0 <= e.y0 < e.y1 <= height


def test_every_storey_has_a_window_per_column_and_there_is_one_door(painted):
    assert sum(e.label == "door" for e in painted.elements) == 1
    elsewhere = ("ground", "dormer")
    upper = [
        e
        for e, state in zip(painted.elements, painted.element_states, strict=True)
        if e.label == "window" and not state.split(":")[1].startswith(elsewhere)
    ]
    assert len(upper) == 3 * 4
    assert len({e.x0 + e.x1 for e in upper}) == 4
    assert len({e.y0 for e in upper}) == 3


def test_states_name_their_label_and_vary(painted):
    for element, state in zip(painted.elements, painted.element_states, strict=True):
        assert state.split(":")[0] == element.label
    windows = {s for s in painted.element_states if s.startswith("window:")}
    assert len(windows) >= 3


def test_windows_look_unlike_the_wall(painted):
    upper = painted.image[: int(0.7 * 188)].astype(float)
    bare = painted.labels[: int(0.7 * 188)] == FacadeClass.WALL
    wall = np.median(upper[bare], axis=0)
    usual = np.abs(upper[bare] - wall).max(1).mean()
    off = [
        np.abs(painted.image[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] - wall).max(2).mean()
        for e in painted.elements
        if e.label == "window" and e.y1 < 0.7 * 188
    ]
    assert min(off) > 1.2 * usual
    assert np.mean(off) > 2 * usual


def test_equal_states_look_more_alike_than_unequal_ones():
    result = paint("functionalist", size_m=(20.0, 20.0), floors=6, columns=6, metres_per_pixel=0.05)
    patches: dict[str, list[np.ndarray]] = {}
    for e, state in zip(result.elements, result.element_states, strict=True):
        if state in ("window:clear", "window:blind-full") and e.y1 - e.y0 > 10:
            patch = result.image[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)].astype(float)
            patches.setdefault(state, []).append(patch)
    clear, blind = patches["window:clear"], patches["window:blind-full"]
    assert len(clear) > 1
    within = max(np.abs(clear[0] - p).mean() for p in clear[1:])
    between = min(np.abs(clear[0] - p).mean() for p in blind)
    assert between > 1.5 * within, "panes of one state mirror this or that"


def test_panes_are_dark():
    for style in ("neoclassical", "functionalist", "haussmann"):
        result = paint(style)
        grey = result.image.mean(2)
        panes = np.percentile(grey[result.labels == FacadeClass.WINDOW], 25)
        assert panes < 0.55 * np.median(grey[result.labels == FacadeClass.WALL])


@pytest.mark.parametrize("seed", range(3))
def test_shops_and_balconies_keep_off_the_ends_and_shops_have_piers(seed):
    for style in ("functionalist", "haussmann"):
        result = paint(style, floors=3, columns=7, size_m=(11.0, 21.0), metres_per_pixel=0.1, seed=seed)
        width = result.labels.shape[1]
        for e in result.elements:
            if e.label in ("shop", "balcony"):
                assert e.x0 * 0.1 >= 0.5 - 1e-9
                assert (width - e.x1) * 0.1 >= 0.5 - 1e-9
        shops = [e for e in result.elements if e.label == "shop"]
        assert all(b.x0 - a.x1 >= 4 for a, b in zip(shops, shops[1:], strict=False)), "a pier between bays"


def test_no_name_is_twice_in_a_parade():
    names = [shop.name.lower() for shop in design_shops(12, np.random.default_rng(4))]
    assert len(set(names)) == 12


def test_same_arguments_same_bits():
    first, second = paint("brick", occluders=2), paint("brick", occluders=2)
    for field in fields(PaintedFacade):
        np.testing.assert_equal(getattr(first, field.name), getattr(second, field.name))
    assert (paint("brick", seed=6).image != first.image).any()


def test_frozen():
    with pytest.raises(FrozenInstanceError):
        paint().floors = 3


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_occluded_is_exactly_what_changed(count):
    clean, busy = paint(seed=count), paint(seed=count, occluders=count)
    np.testing.assert_array_equal(busy.occluded, (clean.image != busy.image).any(2))
    np.testing.assert_array_equal(busy.labels, clean.labels)
    assert busy.elements == clean.elements
    assert busy.element_states == clean.element_states
    assert busy.occluded.any()


@pytest.mark.parametrize("size", [(20.0, 18.0), (13.0, 24.0), (24.0, 10.0)])
@pytest.mark.parametrize("count", [2, 3])
def test_two_or_three_occluders_hide_a_fair_share(size, count):
    for seed in range(3):
        result = paint(size_m=size, occluders=count, seed=seed, metres_per_pixel=0.1)
        assert 0.08 <= result.occluded.mean() <= 0.25
        below = result.occluded[result.occluded.shape[0] // 2 :].sum()
        assert below > 0.5 * result.occluded.sum()


def test_never_more_than_two_fifths_hidden():
    for seed in range(4):
        assert paint(size_m=(5.5, 8.0), floors=2, columns=3, occluders=12, seed=seed).occluded.mean() <= 0.40


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize(("floors", "columns", "size"), [(1, 1, (2.4, 1.5)), (1, 5, (4.0, 9.0)), (2, 1, (4.8, 12.0))])
def test_small_and_odd_facades_are_painted(style, floors, columns, size):
    for mpp in (0.03, 0.2):
        result = paint(style, floors=floors, columns=columns, size_m=size, metres_per_pixel=mpp, occluders=1)
        height, width = result.labels.shape
        assert (height, width) == (round(size[0] / mpp), round(size[1] / mpp))
        assert all(0 <= e.x0 < e.x1 <= width and 0 <= e.y0 < e.y1 <= height for e in result.elements)
        assert sum(e.label == "door" for e in result.elements) == 1


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"style": "gothic"}, "gothic"),
        ({"size_m": (9.0, 12.0)}, "4 floors"),
        ({"size_m": (15.0, 5.0)}, "4 columns"),
        ({"size_m": (float("nan"), 12.0)}, "size_m"),
        ({"size_m": (15.0, -1.0)}, "size_m"),
        ({"floors": 0}, "floors"),
        ({"columns": 0}, "columns"),
        ({"columns": 2.5}, "columns"),
        ({"occluders": -1}, "occluders"),
        ({"seed": -1}, "seed"),
        ({"metres_per_pixel": 0.0}, "metres_per_pixel"),
        ({"size_m": (300.0, 300.0), "metres_per_pixel": 0.02}, "coarser"),
    ],
)
def test_bad_input_is_named(changes, names):
    with pytest.raises(FacadeError, match=names) as caught:
        paint(**changes)
    assert "\n" not in str(caught.value)


def test_exemplars_are_varied_and_to_scale():
    library = paint_exemplar_set(10, seed=3, metres_per_pixel=0.1, occluded_share=0.4)
    assert len(library) == 10
    assert sum(p.occluded.any() for p in library) == 4
    assert len({(p.floors, p.columns) for p in library}) >= 6
    for p in library:
        assert 3 <= p.floors <= 7
        assert 3 <= p.columns <= 8
        assert 9.9 <= p.image.shape[1] * 0.1 <= 26.1
        assert (p.labels == FacadeClass.WINDOW).mean() > 0.05
    again = paint_exemplar_set(3, seed=3, metres_per_pixel=0.1)
    np.testing.assert_array_equal(again[2].labels, library[2].labels)
    assert not any(p.occluded.any() for p in again)


def test_storeys_of_exemplars_are_about_three_metres():
    for p in paint_exemplar_set(5, seed=8, metres_per_pixel=0.1):
        named = zip(p.elements, p.element_states, strict=True)
        tops = {e.y0 for e, state in named if state.startswith("window:") and "ground" not in state}
        roof = int((p.labels[:, 0] == FacadeClass.ROOF).sum())
        rises = np.diff(sorted(y for y in tops if y > roof)) * 0.1
        assert rises.size >= 1
        assert (rises > 2.8).all()
        assert (rises < 3.7).all()


@pytest.mark.parametrize(
    "arguments", [{"n": -1, "seed": 0}, {"n": 1, "seed": 0, "occluded_share": 1.5}, {"n": 1, "seed": -2}]
)
def test_bad_library_requests(arguments):
    with pytest.raises(FacadeError):
        paint_exemplar_set(**arguments)
