import json
from itertools import islice

import numpy as np
import pytest
from PIL import Image

from facade_core.core.errors import ImageError, InputError
from facade_core.core.labels import UNKNOWN, FacadeClass
from training.datasets.facades import (
    ARTDECO,
    CMP,
    ECP,
    LABELMEFACADE,
    RUEMONGE,
    read_dataset,
    read_swiss_street_photos,
    split_facades_for_training,
)

ANY = 0b1111111


def write(folder, name, label_map, size=None):
    for part in ("images", "labels"):
        (folder / part).mkdir(exist_ok=True)
    height, width = size or label_map.shape
    Image.fromarray(np.full((height, width, 3), 90, np.uint8)).save(folder / "images" / f"{name}.jpg")
    Image.fromarray(label_map).save(folder / "labels" / f"{name}.png")


def test_reads_in_name_order_and_maps_chimney_and_void(tmp_path):
    write(tmp_path, "b", np.array([[1, 7], [255, 4]], np.uint8))
    write(tmp_path, "a", np.zeros((3, 2), np.uint8))
    first, second = read_dataset(ECP, tmp_path)
    assert (first.name, second.name) == ("a", "b")
    assert first.image.shape == (3, 2, 3)
    assert second.labels.tolist() == [[FacadeClass.WINDOW, FacadeClass.ROOF], [UNKNOWN, FacadeClass.ROOF]]
    assert second.possible.tolist() == [[1 << FacadeClass.WINDOW, 1 << FacadeClass.ROOF], [ANY, 1 << FacadeClass.ROOF]]
    assert second.occluder.tolist() == [[0, 0], [UNKNOWN, 0]]
    assert second.outside.tolist() == [[0, 0], [UNKNOWN, 0]]


def test_ids_that_may_be_one_of_several_classes(tmp_path):
    write(tmp_path, "a", np.array([[1, 2, 3, 4], [5, 7, 8, 9]], np.uint8))
    (facade,) = read_dataset(CMP, tmp_path)
    assert facade.labels.tolist() == [
        [UNKNOWN, FacadeClass.WALL, FacadeClass.WINDOW, FacadeClass.DOOR],
        [UNKNOWN, FacadeClass.BALCONY, UNKNOWN, FacadeClass.WALL],
    ]
    assert facade.possible[0, 0] == ANY
    assert facade.possible[1, 0] == 1 << FacadeClass.WALL | 1 << FacadeClass.ROOF
    assert facade.possible[1, 2] == 1 << FacadeClass.WALL | 1 << FacadeClass.WINDOW
    assert (facade.occluder == UNKNOWN).all()
    assert facade.outside.tolist() == [[1, 0, 0, 0], [0, 0, 0, 0]]


def test_the_ids_of_street_photos(tmp_path):
    write(tmp_path, "a", np.arange(8, dtype=np.uint8)[None])
    (facade,) = read_dataset(RUEMONGE, tmp_path)
    assert facade.labels.tolist() == [
        [
            UNKNOWN,
            FacadeClass.WINDOW,
            FacadeClass.WALL,
            FacadeClass.BALCONY,
            FacadeClass.DOOR,
            FacadeClass.ROOF,
            FacadeClass.SKY,
            5,
        ]
    ]
    write(tmp_path, "a", np.array([[0, 1, 2, 5, 6, 7]], np.uint8))
    (photo,) = read_dataset(LABELMEFACADE, tmp_path)
    assert photo.occluder.tolist() == [[UNKNOWN, 0, 1, 0, 0, 1]]
    assert photo.outside.tolist() == [[UNKNOWN, 0, UNKNOWN, 1, 1, UNKNOWN]]
    assert photo.labels.tolist() == [[UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, FacadeClass.SKY, UNKNOWN]]


def polygon(number, category, x0, y0, x1, y1):
    return {
        "id": number,
        "image_id": 4,
        "category_id": category,
        "area": (x1 - x0) * (y1 - y0),
        "segmentation": [x0, y0, x1, y0, x1, y1, x0, y1],
    }


@pytest.fixture
def swiss_folder(tmp_path):
    Image.fromarray(np.full((40, 50, 3), 90, np.uint8)).save(tmp_path / "one.jpg")
    record = {
        "categories": [{"id": 0, "name": "facade"}, {"id": 1, "name": "window"}, {"id": 2, "name": "vegetation"}],
        "images": [{"id": 4, "file_name": "one.jpg"}],
        "annotations": [
            polygon(2, 1, 20, 25, 24, 29),
            polygon(1, 2, 0, 20, 30, 39),
            polygon(0, 0, 0, 10, 49, 39),
        ],
    }
    (tmp_path / "annotations.coco.json").write_text(json.dumps(record))
    return tmp_path


def test_polygons_small_over_large(swiss_folder):
    (photo,) = read_swiss_street_photos(swiss_folder)
    assert photo.name == "one"
    assert (photo.labels[22, 25], photo.occluder[22, 25]) == (UNKNOWN, 1)  # the tree
    assert (photo.labels[27, 22], photo.occluder[27, 22]) == (
        FacadeClass.WINDOW,
        UNKNOWN,
    )  # a window over the tree: which is in front?
    assert (photo.possible[15, 5], photo.occluder[15, 5]) == (
        1 << FacadeClass.WALL | 1 << FacadeClass.ROOF | 1 << FacadeClass.DOOR,
        0,
    )
    assert (photo.possible[5, 5], photo.occluder[5, 5], photo.outside[5, 5]) == (ANY, 0, 1)  # nothing drawn
    assert (photo.outside[15, 5], photo.outside[22, 25]) == (0, UNKNOWN)


@pytest.mark.parametrize(
    "change",
    [
        {"categories": [{"id": 0, "name": "zebra"}]},
        {"annotations": [{"id": 7, "image_id": 4, "category_id": 0, "area": 1}]},
        {"annotations": [polygon(1, 0, 0, 0, 9, 9) | {"segmentation": [1, 2, 3]}]},
        {"annotations": [polygon(1, 0, 0, 0, 9, 9) | {"image_id": 5}]},
        {"annotations": [polygon(1, 9, 0, 0, 9, 9)]},
        {"images": None},
    ],
)
def test_refuses_other_polygons(swiss_folder, change):
    path = swiss_folder / "annotations.coco.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=r"annotations\.coco\.json: .*fetch"):
        list(read_swiss_street_photos(swiss_folder))


def test_refuses_a_missing_photo_or_list(swiss_folder, tmp_path_factory):
    (swiss_folder / "one.jpg").unlink()
    with pytest.raises(ImageError, match=r"one\.jpg"):
        list(read_swiss_street_photos(swiss_folder))
    with pytest.raises(InputError, match="fetch the file again"):
        list(read_swiss_street_photos(tmp_path_factory.mktemp("empty")))


def test_refuses_an_empty_folder(tmp_path):
    with pytest.raises(InputError, match="no images"):
        list(read_dataset(ECP, tmp_path))


def test_refuses_half_a_pair(tmp_path):
    write(tmp_path, "a", np.zeros((3, 2), np.uint8))
    (tmp_path / "labels" / "a.png").rename(tmp_path / "labels" / "other.png")
    with pytest.raises(InputError, match="a has an image or a label map"):
        list(read_dataset(ARTDECO, tmp_path))


@pytest.mark.parametrize(
    ("label_map", "size", "message"),
    [
        (np.full((3, 2), 9, np.uint8), None, r"\[9\] are not in the table"),
        (np.zeros((3, 2), np.uint8), (4, 2), "image's size"),
        (np.zeros((3, 2, 3), np.uint8), (3, 2), "one byte"),
    ],
)
def test_refuses_label_maps_that_do_not_fit(tmp_path, label_map, size, message):
    write(tmp_path, "a", label_map, size)
    with pytest.raises(ImageError, match=message):
        list(read_dataset(ECP, tmp_path))


def test_refuses_a_broken_image(tmp_path):
    write(tmp_path, "a", np.zeros((3, 2), np.uint8))
    (tmp_path / "images" / "a.jpg").write_bytes(b"nothing")
    with pytest.raises(ImageError, match=r"a\.jpg"):
        list(read_dataset(ECP, tmp_path))


def test_only_sets_with_a_licence_may_train():
    assert ECP.may_train
    assert CMP.may_train
    assert not any(recipe.may_train for recipe in (ARTDECO, RUEMONGE, LABELMEFACADE))


def test_the_real_sets(data):
    facades = list(read_dataset(ECP, data / "facades" / "ecp"))
    training, held_out = split_facades_for_training(facades)
    assert (len(facades), len(training), len(held_out)) == (83, 66, 17)
    assert not {facade.name for facade in training} & {facade.name for facade in held_out}
    share = np.bincount(np.concatenate([facade.labels.reshape(-1) for facade in facades]), minlength=256)
    assert share[7:255].sum() == 0
    np.testing.assert_allclose(share[:7] / share.sum(), [0.468, 0.110, 0.130, 0.014, 0.075, 0.127, 0.074], atol=1e-3)
    assert sum(1 for _ in read_dataset(ARTDECO, data / "facades" / "artdeco")) == 63


def test_every_real_set_fits_its_table(data):
    """The first photos of each set: reading refuses ids that the table lacks."""
    folders = {
        "facades/cmp": CMP,
        "facades/ruemonge2014/val": RUEMONGE,
        "streetphotos/labelmefacade": LABELMEFACADE,
    }
    for folder, recipe in folders.items():
        shown = {
            label for facade in islice(read_dataset(recipe, data / folder), 8) for label in np.unique(facade.labels)
        }
        assert {FacadeClass.WINDOW, UNKNOWN} <= shown
    photos = list(islice(read_swiss_street_photos(data / "streetphotos" / "swiss" / "test"), 12))
    assert np.mean([(photo.occluder == 1).mean() for photo in photos]) > 0.02
    assert all((photo.labels == FacadeClass.WINDOW).any() for photo in photos)
