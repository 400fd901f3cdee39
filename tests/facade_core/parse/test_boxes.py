import numpy as np
import pytest

from facade_core.core.errors import ImageError
from facade_core.core.labels import UNKNOWN, FacadeClass
from facade_core.core.types import Element, Parsing
from facade_core.parsing.elements import elements, split_balconies


def wall(height=200, width=160):
    return np.full((height, width), FacadeClass.WALL, np.uint8)


def test_rectangles_come_back_exactly_and_in_reading_order():
    labels = wall()
    truth = [
        Element("window", 100, 20, 120, 50),
        Element("window", 20, 20, 40, 50),
        Element("balcony", 15, 50, 45, 60),
        Element("door", 70, 150, 90, 200),
        Element("shop", 100, 140, 160, 200),
    ]
    ids = {
        "window": FacadeClass.WINDOW,
        "balcony": FacadeClass.BALCONY,
        "door": FacadeClass.DOOR,
        "shop": FacadeClass.SHOP,
    }
    for element in truth:
        labels[int(element.y0) : int(element.y1), int(element.x0) : int(element.x1)] = ids[element.label]
    assert elements(labels) == sorted(truth, key=lambda element: (element.y0, element.x0))


def test_noise_is_dropped_and_a_ragged_edge_is_cleaned():
    labels = wall()
    labels[40:80, 60:90] = FacadeClass.WINDOW
    labels[50, 90:97] = FacadeClass.WINDOW  # a spike
    labels[80:83, 70] = FacadeClass.WINDOW
    labels[45:48, 62:64] = FacadeClass.WALL  # a hole
    labels[150:152, 20:22] = FacadeClass.WINDOW  # a speck
    assert elements(labels) == [Element("window", 60, 40, 90, 80)]


def test_windows_joined_by_a_bridge_are_parted():
    labels = wall()
    labels[40:80, 20:40] = FacadeClass.WINDOW
    labels[40:80, 50:70] = FacadeClass.WINDOW
    labels[40:80, 80:100] = FacadeClass.WINDOW
    labels[55:61, 40:80] = FacadeClass.WINDOW
    assert elements(labels) == [Element("window", x, 40, x + 20, 80) for x in (20, 50, 80)]


def test_windows_joined_one_above_the_other_are_parted():
    labels = wall()
    labels[20:60, 30:50] = FacadeClass.WINDOW
    labels[60:70, 38:42] = FacadeClass.WINDOW
    labels[70:110, 30:50] = FacadeClass.WINDOW
    assert elements(labels) == [Element("window", 30, 20, 50, 60), Element("window", 30, 70, 50, 110)]


def test_a_running_balcony_with_posts_stays_one():
    labels = wall()
    labels[100:110, 10:150] = FacadeClass.BALCONY
    labels[90:100, 10:13] = FacadeClass.BALCONY
    labels[90:100, 147:150] = FacadeClass.BALCONY
    assert elements(labels) == [Element("balcony", 10, 100, 150, 110)]


def test_hidden_boxes_are_no_observation():
    labels = wall()
    labels[20:50, 20:40] = FacadeClass.WINDOW
    labels[20:50, 100:120] = FacadeClass.WINDOW
    occluded = np.zeros(labels.shape, bool)
    occluded[:, 90:112] = True  # more than half of the second
    confidence = np.full((*labels.shape, 7), 1 / 7, np.float32)
    assert elements(Parsing(labels, confidence, occluded)) == [Element("window", 20, 20, 40, 50)]
    assert len(elements(labels)) == 2


def test_small_and_empty_maps():
    assert elements(wall(1, 1)) == []
    assert elements(np.full((1, 1), FacadeClass.WINDOW, np.uint8)) == [Element("window", 0, 0, 1, 1)]
    assert elements(np.full((5, 5), UNKNOWN, np.uint8)) == []


def test_refuses_what_is_no_label_map():
    with pytest.raises(ImageError, match="uint8"):
        elements(np.zeros((3, 3), np.int64))
    with pytest.raises(ImageError, match="id 9"):
        elements(np.full((3, 3), 9, np.uint8))


def test_boxes_stay_inside_and_filled_on_random_maps():
    rng = np.random.default_rng(5)
    for _ in range(20):
        coarse = rng.integers(0, 4, (12, 15)).astype(np.uint8)
        labels = np.kron(coarse, np.ones((6, 5), np.uint8))
        found = elements(labels)
        assert found
        for element in found:
            assert 0 <= element.x0 < element.x1 <= labels.shape[1]
            assert 0 <= element.y0 < element.y1 <= labels.shape[0]
            inside = labels[int(element.y0) : int(element.y1), int(element.x0) : int(element.x1)]
            assert (inside == ("wall", "window", "balcony", "door").index(element.label)).any()


def floor_with_balcony():
    """Three windows over one balcony that runs before them all."""
    labels = wall()
    for x in (20, 65, 110):
        labels[40:80, x : x + 20] = FacadeClass.WINDOW
    labels[70:90, 15:135] = FacadeClass.BALCONY
    return labels


def test_a_balcony_that_runs_on_is_one_element():
    assert [(e.x0, e.x1) for e in elements(floor_with_balcony()) if e.label == "balcony"] == [(15, 135)]


def test_balconies_that_have_grown_together_are_parted_between_their_windows():
    labels = floor_with_balcony()
    labels[70:78, 50:60] = FacadeClass.WALL  # half as high as before the windows
    found = [(e.x0, e.x1) for e in elements(labels) if e.label == "balcony"]
    assert len(found) == 2
    assert found[0][0] == 15
    assert found[1][1] == 135
    assert found[0][1] == found[1][0]
    assert 50 <= found[0][1] < 60


def test_a_notch_before_a_window_parts_nothing():
    labels = floor_with_balcony()
    labels[70:78, 70:80] = FacadeClass.WALL
    assert sum(e.label == "balcony" for e in elements(labels)) == 1


def test_per_window_gives_each_window_its_part_of_a_balcony():
    windows = [Element("window", x, 40, x + 20, 80) for x in (20, 65, 110)]
    below = Element("window", 20, 120, 40, 160)
    shared, own = Element("balcony", 15, 70, 135, 90, 0.8), Element("balcony", 15, 150, 45, 170)
    parts = [e for e in split_balconies([*windows, below, shared, own]) if e.label == "balcony"]
    assert [(e.x0, e.x1) for e in parts] == [(15, 52.5), (52.5, 97.5), (97.5, 135), (15, 45)]
    assert [e.confidence for e in parts] == [0.8, 0.8, 0.8, 1.0]
    assert split_balconies(windows) == windows


def test_confidence_is_the_mean_over_the_box():
    labels = wall()
    labels[40:80, 60:90] = FacadeClass.WINDOW
    confidence = np.zeros((*labels.shape, 7), np.float32)
    confidence[..., FacadeClass.WALL] = 1
    confidence[40:80, 60:90] = 0
    confidence[40:80, 60:75, FacadeClass.WINDOW], confidence[40:80, 75:90, FacadeClass.WINDOW] = 0.6, 1.0
    parsing = Parsing(labels, confidence, np.zeros(labels.shape, bool))
    (window,) = elements(parsing)
    assert window.confidence == pytest.approx(0.8)
    assert [e.confidence for e in elements(labels)] == [1.0]
