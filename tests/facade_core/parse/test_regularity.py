import numpy as np
import pytest

from facade_core.core.labels import FacadeClass
from facade_core.parsing.regularity import _group_intervals, draw_windows_into_labels, extract_regular_window_boxes


def facade():
    """Three floors of four windows, balconies under the middle one's, and a door."""
    labels = np.full((220, 200), FacadeClass.WALL, np.uint8)
    for y in (20, 80, 140):
        for x in (20, 66, 112, 158):
            labels[y : y + 36, x : x + 22] = FacadeClass.WINDOW
            if y == 80:
                labels[y + 26 : y + 40, x - 4 : x + 26] = FacadeClass.BALCONY
    labels[185:, 90:112] = FacadeClass.DOOR
    return labels


def confidence_of(labels, sure=0.8):
    share = np.full((*labels.shape, 7), (1 - sure) / 6, np.float32)
    np.put_along_axis(share, labels[..., None].astype(np.intp), sure, axis=2)
    return share


def ragged(labels, seed):
    """The labels with edges that wander by up to three pixels, and their confidence low beside the edges."""
    from scipy import ndimage

    rng = np.random.default_rng(seed)
    shift = [ndimage.gaussian_filter(rng.normal(0, 1, labels.shape), 3) for _ in range(2)]
    y, x = np.mgrid[: labels.shape[0], : labels.shape[1]]
    rows = np.clip(np.rint(y + 25 * shift[0]), 0, labels.shape[0] - 1).astype(int)
    columns = np.clip(np.rint(x + 25 * shift[1]), 0, labels.shape[1] - 1).astype(int)
    return ndimage.gaussian_filter(confidence_of(labels[rows, columns]), (1, 1, 0))


def regularise(confidence):
    """Confidence and labels with regular windows, of a map at the size that it was made at."""
    labels, confidence = confidence.argmax(2).astype(np.uint8), confidence.copy()
    draw_windows_into_labels(labels, confidence, extract_regular_window_boxes(confidence))
    return confidence, labels


def regular_labels(confidence):
    return regularise(confidence)[1]


def test_a_clean_parse_stays_as_it_is():
    labels = facade()
    assert (regular_labels(confidence_of(labels)) == labels).all()


def test_confidence_is_exchanged_where_the_label_changes():
    confidence = ragged(facade(), 1)
    found, labels = regularise(confidence)
    assert (found.argmax(2) == labels).all()
    np.testing.assert_allclose(np.sort(found, axis=2), np.sort(confidence, axis=2))
    same = confidence.argmax(2) == labels
    assert (found[same] == confidence[same]).all()
    assert not same.all()


@pytest.mark.parametrize("seed", range(3))
def test_ragged_edges_become_straight(seed):
    labels = facade()
    labels[labels == FacadeClass.BALCONY] = FacadeClass.WALL
    confidence = ragged(labels, seed)
    before = (confidence.argmax(2) != labels)[:180].mean()  # the door is left as it is
    after = (regular_labels(confidence) != labels)[:180].mean()
    assert before > 0.01
    assert after < 0.8 * before


def test_windows_of_a_floor_share_lines_unless_the_pixels_say_otherwise():
    labels = facade()
    seen = labels.copy()
    seen[18:20, 66:88] = FacadeClass.WINDOW  # two rows above the others', which nothing speaks strongly for
    confidence = confidence_of(seen)
    weak = confidence_of(seen, sure=0.18)
    confidence[18:20, 66:88] = weak[18:20, 66:88]
    assert (regular_labels(confidence) == labels).all()
    tall = labels.copy()
    tall[8:20, 66:88] = FacadeClass.WINDOW  # a taller window that is sure
    assert (regular_labels(confidence_of(tall)) == tall).all()


def test_what_is_no_rectangle_is_left_alone():
    labels = np.full((100, 100), FacadeClass.WALL, np.uint8)
    y, x = np.mgrid[:100, :100]
    labels[(x > y - 20) & (x < y) & (y > 20) & (y < 80)] = FacadeClass.WINDOW  # slanting
    found = regular_labels(confidence_of(labels))
    assert ((found == FacadeClass.WINDOW) & (labels == FacadeClass.WALL)).mean() < 0.05


def test_windows_that_touch_are_not_drawn_as_one():
    labels = np.full((120, 160), FacadeClass.WALL, np.uint8)
    for x in (20, 66, 112):
        labels[50:64, x : x + 34] = FacadeClass.WINDOW
    labels[56:62, 54:66] = FacadeClass.WINDOW  # a bridge, of less than half the height
    found = regular_labels(confidence_of(labels))
    assert (found[50:55, 54:66] == FacadeClass.WALL).all()
    assert (found == labels).mean() > 0.995


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (3, 2)])
def test_tiny_maps(shape):
    labels = np.full(shape, FacadeClass.WINDOW, np.uint8)
    assert (regular_labels(confidence_of(labels)) == FacadeClass.WINDOW).all()


def test_groups_are_floors():
    low, high = np.array([0, 50, 2, 52, 20]), np.array([30, 80, 32, 82, 60])
    assert _group_intervals(low, high) == [[0, 2], [4], [1, 3]]
