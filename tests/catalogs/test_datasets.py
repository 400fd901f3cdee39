import numpy as np
import pytest
from PIL import Image

from catalogs.datasets import ARTDECO, ECP, RECIPES, artdeco, ecp, split
from facade_core.errors import ImageError, InputError
from facade_core.labels import ROOF, UNKNOWN, WINDOW


def write(folder, name, label_map, size=None):
    for part in ("images", "labels"):
        (folder / part).mkdir(exist_ok=True)
    height, width = size or label_map.shape
    Image.fromarray(np.full((height, width, 3), 90, np.uint8)).save(folder / "images" / f"{name}.jpg")
    Image.fromarray(label_map).save(folder / "labels" / f"{name}.png")


def test_reads_in_name_order_and_maps_chimney_and_void(tmp_path):
    write(tmp_path, "b", np.array([[1, 7], [255, 4]], np.uint8))
    write(tmp_path, "a", np.zeros((3, 2), np.uint8))
    first, second = ecp(tmp_path)
    assert (first.name, second.name) == ("a", "b")
    assert first.image.shape == (3, 2, 3)
    assert second.labels.tolist() == [[WINDOW, ROOF], [UNKNOWN, ROOF]]


def test_refuses_an_empty_folder(tmp_path):
    with pytest.raises(InputError, match="no images"):
        list(ecp(tmp_path))


def test_refuses_half_a_pair(tmp_path):
    write(tmp_path, "a", np.zeros((3, 2), np.uint8))
    (tmp_path / "labels" / "a.png").rename(tmp_path / "labels" / "other.png")
    with pytest.raises(InputError, match="a has an image or a label map"):
        list(artdeco(tmp_path))


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
        list(ecp(tmp_path))


def test_refuses_a_broken_image(tmp_path):
    write(tmp_path, "a", np.zeros((3, 2), np.uint8))
    (tmp_path / "images" / "a.jpg").write_bytes(b"nothing")
    with pytest.raises(ImageError, match=r"a\.jpg"):
        list(ecp(tmp_path))


def test_only_sets_with_a_licence_may_train():
    assert ECP.may_train
    assert not ARTDECO.may_train
    assert all(name == recipe.name for name, recipe in RECIPES.items())


@pytest.mark.realdata
def test_the_real_sets(data):
    facades = list(ecp(data / "facades" / "ecp"))
    training, held_out = split(facades)
    assert (len(facades), len(training), len(held_out)) == (83, 66, 17)
    assert not {facade.name for facade in training} & {facade.name for facade in held_out}
    share = np.bincount(np.concatenate([facade.labels.reshape(-1) for facade in facades]), minlength=256)
    assert share[7:255].sum() == 0
    np.testing.assert_allclose(share[:7] / share.sum(), [0.468, 0.110, 0.130, 0.014, 0.075, 0.127, 0.074], atol=1e-3)
    assert sum(1 for _ in artdeco(data / "facades" / "artdeco")) == 63
