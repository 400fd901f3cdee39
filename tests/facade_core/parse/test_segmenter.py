import tracemalloc

import numpy as np
import pytest

from facade_core.core.errors import ImageError, ModelFileError
from facade_core.core.labels import CLASSES, UNKNOWN, FacadeClass
from facade_core.parsing.elements import elements
from facade_core.parsing.segmenter import _occluder_regions, parse

COLOURS = {
    FacadeClass.WALL: (205, 190, 165),
    FacadeClass.WINDOW: (62, 70, 84),
    FacadeClass.BALCONY: (70, 66, 66),
    FacadeClass.DOOR: (104, 62, 40),
    FacadeClass.ROOF: (92, 98, 112),
    FacadeClass.SHOP: (38, 52, 96),  # a plain green band at the foot is taken for a hedge
    FacadeClass.SKY: (196, 214, 236),
}


def painted_facade(seed=0, noise=4.0):
    """Five storeys of four windows under a roof and sky, over shops and a door: image and labels."""
    labels = np.full((540, 330), FacadeClass.WALL, np.uint8)
    labels[:45], labels[45:100] = FacadeClass.SKY, FacadeClass.ROOF
    for y in range(120, 440, 66):
        for x in range(30, 320, 76):
            labels[y : y + 42, x : x + 26] = FacadeClass.WINDOW
            labels[y + 32 : y + 46, x - 4 : x + 30] = FacadeClass.BALCONY
    labels[455:] = FacadeClass.SHOP
    labels[455:, 140:190] = FacadeClass.WALL
    labels[470:, 150:180] = FacadeClass.DOOR
    image = np.zeros((*labels.shape, 3))
    for label, colour in COLOURS.items():
        image[labels == label] = colour
    image += np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.clip(image, 0, 255).astype(np.uint8), labels


def agreement(truth, labels):
    known = truth != UNKNOWN
    return float((truth[known] == labels[known]).mean())


def test_parses_a_painted_facade():
    image, truth = painted_facade()
    found = parse(image)
    assert found.labels.dtype == np.uint8
    assert found.confidence.shape == (*truth.shape, len(CLASSES))
    assert found.confidence.dtype == np.float32
    np.testing.assert_allclose(found.confidence.sum(2), 1, atol=1e-5)
    assert (found.labels == found.confidence.argmax(2)).all()
    assert not found.occluded.any()
    assert agreement(truth, found.labels) > 0.8
    windows = [element for element in elements(found) if element.label == "window"]
    assert 16 <= len(windows) <= 24


def test_a_texture_without_sky_and_roof_has_none():
    image, truth = painted_facade()
    found = parse(image[112:])
    assert agreement(truth[112:], found.labels) > 0.75
    assert np.isin(found.labels, (FacadeClass.SKY, FacadeClass.ROOF)).mean() < 0.05


def test_equal_input_gives_equal_bits():
    image, _ = painted_facade()
    first, second = parse(image), parse(image.copy())
    assert (first.confidence == second.confidence).all()


def test_what_stands_at_the_foot_goes_on_a_little_where_the_network_doubts():
    likely = np.zeros((200, 200), np.float32)  # whose reach is 8
    likely[150:, 40:60] = 0.9  # stands at the foot
    likely[140:150, 40:60] = likely[190:, 60:66] = 0.35  # its head, and what is joined to it
    likely[20:60, 100:120] = 0.9  # hangs higher: its border is where it was
    likely[60:70, 100:120] = 0.35
    likely[150:, 150:160] = 0.35  # doubtful alone
    expected = np.zeros(likely.shape, bool)
    expected[142:, 40:60] = expected[190:, 60:66] = expected[20:60, 100:120] = True
    np.testing.assert_array_equal(_occluder_regions(likely), expected)


def test_alpha_hides_pixels():
    image, truth = painted_facade()
    alpha = np.full(truth.shape, 255, np.uint8)
    alpha[300:400, 100:200] = 127
    plain = parse(np.dstack([image, alpha]))
    assert (plain.occluded == (alpha < 128)).all()
    assert plain.labels.max() < len(CLASSES)
    # What is hidden has no say.
    other = image.copy()
    other[alpha < 128] = (255, 0, 255)
    again = parse(np.dstack([other, alpha]))
    assert (again.confidence == plain.confidence).all()
    # Hidden pixels take over from the nearest visible one: here the one straight to the left or right.
    assert (plain.confidence[350, 100:110] == plain.confidence[350, 99]).all()


def test_alpha_in_a_shrunk_image_keeps_hidden_colours_out():
    image, _ = painted_facade()
    image = np.repeat(np.repeat(image, 3, 0), 3, 1)
    alpha = np.full(image.shape[:2], 255, np.uint8)
    alpha[700:1000, 200:510] = 0
    other = image.copy()
    other[alpha == 0] = (0, 255, 0)
    assert (parse(np.dstack([image, alpha])).labels == parse(np.dstack([other, alpha])).labels).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (3, 2), (5, 4000)])
def test_small_and_narrow_images(shape):
    image = np.random.default_rng(1).integers(0, 256, (*shape, 3), dtype=np.uint8)
    found = parse(image)
    assert found.labels.shape == shape
    np.testing.assert_allclose(found.confidence.sum(2), 1, atol=1e-5)


def test_large_images_take_bounded_memory_and_keep_their_parse():
    image, truth = painted_facade(noise=0)
    large = np.repeat(np.repeat(image, 6, 0), 6, 1)  # 6.4 megapixels
    tracemalloc.start()
    found = parse(large)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    result = found.labels.nbytes + found.confidence.nbytes + found.occluded.nbytes
    assert peak < result + 3 * large.nbytes + 200e6
    assert agreement(np.repeat(np.repeat(truth, 6, 0), 6, 1), found.labels) > 0.8


def test_a_facade_at_a_third_of_its_size_keeps_its_windows():
    image, truth = painted_facade()
    small = np.ascontiguousarray(image[1::3, 1::3])
    assert agreement(truth[1::3, 1::3], parse(small).labels) > 0.75
    assert 14 <= sum(element.label == "window" for element in elements(parse(small))) <= 24


@pytest.mark.parametrize("scale", [0.7, 1.0, 1.9])
def test_windows_are_rectangles_at_any_size(scale):
    """Also where the picture is not of the size that it is parsed at: enlarged with the rest, their corners would be round."""
    import cv2

    image, _ = painted_facade()
    found = parse(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))
    windows = [element for element in elements(found) if element.label == "window"]
    boxes = [found.labels[int(e.y0) : int(e.y1), int(e.x0) : int(e.x1)] for e in windows]
    assert np.mean([(box == FacadeClass.WINDOW).all() for box in boxes]) >= 0.8
    assert (found.labels == found.confidence.argmax(2)).all()


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 4), np.uint8),
        np.zeros((4, 4, 2), np.uint8),
        np.zeros((0, 4, 3), np.uint8),
        np.zeros((4, 4, 3), np.float32),
        [[[0, 0, 0]]],
        np.zeros((4, 4, 4), np.uint8),
    ],
)
def test_refuses_other_images(image):
    with pytest.raises(ImageError, match=r"image: .*(; )"):
        parse(image)


def test_refuses_a_missing_model(tmp_path):
    with pytest.raises(ModelFileError, match="no such file"):
        parse(np.zeros((4, 4, 3), np.uint8), model=tmp_path / "none.onnx")


def test_held_out_facades_and_their_lower_storeys(data):
    from training.datasets.facades import ECP, read_dataset, split_facades_for_training

    _, held_out = split_facades_for_training(list(read_dataset(ECP, data / "facades" / "ecp")))
    whole = [agreement(facade.labels, parse(facade.image).labels) for facade in held_out[::4]]
    assert np.mean(whole) > 0.84
    storeys = [(facade.image[150:], facade.labels[150:]) for facade in held_out[1::4]]
    assert np.mean([agreement(labels, parse(image).labels) for image, labels in storeys]) > 0.8


@pytest.mark.long
def test_sky_street_and_neighbours_of_held_out_facades_are_outside(data):
    from benchmarks.outline import measure_boxes
    from facade_core.parsing.segmenter import facade_surroundings_mask
    from training.datasets.facades import CMP, read_dataset, split_facades_for_training

    _, held_out = split_facades_for_training(list(read_dataset(CMP, data / "facades" / "cmp")))
    much = [facade for facade in held_out if (facade.outside == 1).mean() > 0.1][:6]
    found = measure_boxes(much, lambda image: facade_surroundings_mask(image, np.zeros(image.shape[:2], bool)))
    assert found["outside_after"] < 0.5 * found["outside_before"]
    assert found["facade_lost"] < 0.05


def test_vehicles_before_held_out_facades_are_in_front_and_what_is_beside_them_is_not(data):
    from benchmarks.in_front import marked, measure_things
    from training.datasets.facades import ECP, read_dataset, split_facades_for_training

    _, held_out = split_facades_for_training(list(read_dataset(ECP, data / "facades" / "ecp")))
    found = measure_things(held_out[:6], marked(), lambda image: parse(image).occluded)
    vehicles, there = found["vehicles"]
    assert vehicles >= 0.8 * there
    people, there = found["recall"]["person"]
    assert people >= 0.8 * there
    assert found["beside_boxes"] < 0.25
