import itertools

import numpy as np
import pytest

from facade_core.core.errors import ModelFileError
from facade_core.core.types import Element, TrainedModelFiles
from facade_core.facade.layout.completion import complete
from facade_core.facade.layout.model import SHIPPED_LAYOUT_MODEL, SHIPPED_LAYOUT_NETWORK, load_layout_model
from facade_core.facade.layout.network.raster import CHANNELS, RASTER, STRIDE, WINDOW_PIXELS, draw_boxes, draw_region
from facade_core.facade.layout.network.windows import find_network_windows, load_layout_network, move_to_proposals
from training.layout.network_views import sample_layout_view

DOMAIN = (0.0, 0.0, 120.0, 80.0)
REGION = [(0.0, 0.0, 60.0, 80.0)]
WHOLE = [Element("window", x, y, x + 12, y + 14) for y in (10, 50) for x in (10, 40, 70, 100)]
SEEN = [e for e in WHOLE if e.x0 < 60]


def answer(windows, chance=0.9):
    """A network that knows the windows, in pixels: two to a unit of the facade would not fit, so half a pixel.

    The left half of DOMAIN is seen, so elements drawn on the right are those of the mirrored view.
    """

    def predict(layout):
        assert layout.shape == (1, CHANNELS, *RASTER)
        is_mirrored = layout[0, 0, :, 30:].sum() > layout[0, 0, :, :30].sum()
        raw = np.zeros((4, 5, RASTER[0] // STRIDE, RASTER[1] // STRIDE), np.float32)
        raw[:, 0] = -9
        for e in windows:
            x, y = (e.x0 + e.x1) / 4, (e.y0 + e.y1) / 4
            x = 60 - x if is_mirrored else x
            row, column = int(y // STRIDE), int(x // STRIDE)
            raw[0, :, row, column] = (
                np.log(chance / (1 - chance)),
                (x - (column + 0.5) * STRIDE) / WINDOW_PIXELS[0],
                (y - (row + 0.5) * STRIDE) / WINDOW_PIXELS[1],
                np.log(e.width / 2 / WINDOW_PIXELS[0]),
                np.log(e.height / 2 / WINDOW_PIXELS[1]),
            )
        return raw

    return predict


def test_windows_of_the_network_are_found_in_the_hidden_part_only():
    found = find_network_windows(SEEN, DOMAIN, np.array(REGION), answer(WHOLE))
    np.testing.assert_allclose(
        sorted(found.box.tolist()), sorted([e.x0, e.y0, e.x1, e.y1] for e in WHOLE if e.x0 > 60), atol=1e-4
    )
    np.testing.assert_allclose(found.probability, 0.9, atol=1e-6)
    assert not len(find_network_windows(SEEN, DOMAIN, np.array(REGION), answer(WHOLE, 0.2)).box), "unlikely ones"


def test_a_window_found_in_one_view_only_has_half_of_its_probability():
    other = [Element("window", 64, 10, 76, 24), WHOLE[-1]]
    answers = [answer([*WHOLE[:2], *other]), answer(WHOLE)]

    def predict(layout):
        return answers.pop()(layout)

    found = find_network_windows(SEEN, DOMAIN, np.array(REGION), predict)
    assert len(found.box) == 4
    assert found.probability.round(3).tolist() == [0.9, 0.45, 0.45, 0.45]


def test_the_box_of_a_window_is_the_mean_of_those_of_both_views():
    moved = [Element("window", e.x0 + 2, e.y0, e.x1 + 2, e.y1) for e in WHOLE]
    answers = [answer(moved), answer(WHOLE)]

    def predict(layout):
        return answers.pop()(layout)

    found = find_network_windows(SEEN, DOMAIN, np.array(REGION), predict)
    expected = sorted([e.x0 + 1, e.y0, e.x1 + 1, e.y1] for e in WHOLE if e.x0 > 60)
    np.testing.assert_allclose(sorted(found.box.tolist()), expected, atol=1e-4)


def test_no_window_is_found_by_none_seen_or_too_fine_ones():
    door = [Element("door", 10, 60, 20, 80)]
    assert find_network_windows(door, DOMAIN, np.array(REGION), answer(WHOLE)) is None
    wide = (0.0, 0.0, 1200.0, 80.0)
    assert find_network_windows(SEEN, wide, np.array(REGION), answer(WHOLE)) is None


def test_a_likely_proposal_takes_the_place_of_a_window():
    windows = np.array([(0, 0, 10, 10), (20, 0, 30, 10.0)])
    proposals = np.array([(1, 0, 11, 10), (2, 0, 12, 10), (21, 0, 31, 10.0)])
    moved = move_to_proposals(windows, proposals, np.array([0.6, 0.8, 0.3]))
    assert moved.tolist() == [[2, 0, 12, 10], [20, 0, 30, 10]]


def test_completions_with_the_shipped_network_are_sound_and_repeated():
    rng = np.random.default_rng(1)
    for _ in range(4):
        jitter = rng.uniform(-2, 2, (len(WHOLE), 2))
        whole = [
            Element("window", e.x0 + dx, e.y0 + dy, e.x1 + dx, e.y1 + dy)
            for e, (dx, dy) in zip(WHOLE, jitter, strict=True)
        ]
        seen = [e for e in whole if e.x0 < 60]
        (best,) = complete(seen, DOMAIN, REGION)
        assert complete(seen, DOMAIN, REGION)[0] == best
        assert len(best.elements) > len(seen)
        for a, b in itertools.combinations(best.elements, 2):
            if {a.label, b.label} != {"window", "balcony"}:
                assert min(a.x1, b.x1) <= max(a.x0, b.x0) or min(a.y1, b.y1) <= max(a.y0, b.y0)
        assert all(e.x0 >= 60 for e in best.elements[len(seen) :])


def test_a_layout_model_without_a_network_beside_it_uses_trees_and_a_changed_network_is_refused(tmp_path):
    path = tmp_path / "layouts.json"
    path.write_bytes(SHIPPED_LAYOUT_MODEL.read_bytes())
    assert load_layout_model(path).network is None
    assert TrainedModelFiles(layout=path).files == (path,)
    copy = path.with_name(SHIPPED_LAYOUT_NETWORK.name)
    copy.write_bytes(SHIPPED_LAYOUT_NETWORK.read_bytes()[:-1])
    copy.with_suffix(".json").write_bytes(SHIPPED_LAYOUT_NETWORK.with_suffix(".json").read_bytes())
    assert load_layout_model(path).network == copy
    with pytest.raises(ModelFileError, match="checksum"):
        load_layout_network(copy)


def test_drawn_boxes_keep_their_areas_and_regions_are_mirrored():
    rows, columns = (np.arange(n, dtype=np.float32) for n in RASTER)
    box = np.array([[[1.5, 2.25, 7.0, 9.0], [20, 30, 20.5, 40]]], np.float32)
    drawn = draw_boxes(box, np.ones((1, 2, 1), np.float32), rows, columns)
    assert drawn.sum() == pytest.approx(5.5 * 6.75 + 5, rel=1e-5)
    region = draw_region(np.array([[0.0, 0, 10, 20]]), 50.0)
    assert region[0, :20, :10].all()
    assert region[1, :20, 40:50].all()
    assert region.sum() == 400


def test_no_hidden_element_of_a_view_touches_the_visible_part():
    rng = np.random.default_rng(2)
    views = [v for _ in range(20) if (v := sample_layout_view([(WHOLE, DOMAIN)], (), 0.2, rng)) is not None]
    assert len(views) > 10
    for view in views:
        hidden = view.hidden > 0
        assert hidden.any()
        assert not hidden.all()
        assert (view.box[:, 2] <= RASTER[1] + 1e-3).all()
        for x0, y0, x1, y1 in np.rint(view.box[hidden]).astype(int) + np.array([1, 1, -1, -1]):
            assert view.region[0, max(y0, 0) : max(y1, 0), max(x0, 0) : max(x1, 0)].max(initial=0) < 0.99
