"""Holes filled by LaMa, a network of a user."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from facade_core.core.errors import ModelFileError
from facade_core.core.types import Element
from facade_core.facade.texture import network_inpainting
from facade_core.facade.texture.inpainting import inpaint
from facade_core.facade.texture.network_inpainting import InpaintingNetwork, load_inpainting_network

pytest.importorskip("onnx", reason="onnx is absent: make setup")

from tests.facade_core.external_networks import save_inpainting_network, save_semantic_network


def two_halves(height: int, width: int) -> np.ndarray:
    """A dark left and a light right half."""
    image = np.full((height, width, 3), (40, 60, 80), np.uint8)
    image[:, width // 2 :] = (180, 160, 140)
    return image


@pytest.mark.parametrize("highest", [1.0, 255.0])
@pytest.mark.parametrize("size", [("height", "width"), (512, 512), (64, 96)])
@pytest.mark.parametrize("shape", [(300, 403), (700, 1301), (40, 40)])
def test_only_hidden_pixels_change_and_take_the_networks_colour(
    tmp_path: Path, shape: tuple[int, int], size: tuple[int | str, ...], highest: float
) -> None:
    path = save_inpainting_network(tmp_path / "l.onnx", size=size, highest=highest)
    image = np.full((*shape, 3), (40, 60, 80), np.uint8)
    mask = np.zeros(shape, bool)
    mask[5:20, 3:25] = mask[shape[0] - 9 :, shape[1] // 2 :] = True
    image[mask] = (255, 0, 255)
    filled = inpaint(image, mask, model=path)
    np.testing.assert_array_equal(filled[~mask], image[~mask])
    np.testing.assert_allclose(filled[mask], np.broadcast_to((40, 60, 80), (mask.sum(), 3)), atol=1)


def test_each_hole_is_filled_from_what_is_around_it(tmp_path: Path) -> None:
    path = save_inpainting_network(tmp_path / "l.onnx", size=(64, 64))
    image, mask = two_halves(200, 1200), np.zeros((200, 1200), bool)
    mask[90:110, 200:220] = mask[90:110, 1000:1020] = mask[95:99, 1040:1044] = True
    filled = inpaint(image, mask, model=path)
    np.testing.assert_allclose(filled[mask & (np.arange(1200) < 600)], np.broadcast_to((40, 60, 80), (400, 3)), atol=1)
    np.testing.assert_allclose(
        filled[mask & (np.arange(1200) > 600)], np.broadcast_to((180, 160, 140), (416, 3)), atol=1
    )


def test_holes_beside_each_other_share_a_crop_and_a_large_one_is_reduced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = save_inpainting_network(tmp_path / "l.onnx", size=(128, 128))
    crops, fill = list[tuple[int, ...]](), InpaintingNetwork.fill

    def count_and_fill(network: InpaintingNetwork, image: Any, hidden: Any) -> Any:
        crops.append(hidden.shape)
        return fill(network, image, hidden)

    monkeypatch.setattr(InpaintingNetwork, "fill", count_and_fill)
    image, mask = two_halves(500, 900), np.zeros((500, 900), bool)
    mask[100:110, 100:110] = mask[130:135, 120:125] = mask[100:110, 600:700] = True
    inpaint(image, mask, model=path)
    assert crops == [(200, 200), (128, 128)]


def test_the_same_bits_again_and_other_bits_by_floors(tmp_path: Path, facade: Any) -> None:
    path = save_inpainting_network(tmp_path / "l.onnx")
    mask = np.zeros(facade.labels.shape, bool)
    mask[75:125, 40:75] = True
    one, two = (inpaint(facade.image, mask, labels=facade.labels, model=path) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    assert (one != inpaint(facade.image, mask, labels=facade.labels)).any()


def test_what_the_layout_places_in_a_hole_stays_and_the_network_fills_around_it(tmp_path: Path, facade: Any) -> None:
    path = save_inpainting_network(tmp_path / "l.onnx")
    mask = np.zeros(facade.labels.shape, bool)
    mask[75:128, 40:70] = True
    windows = [
        Element("window", 10 + 36 * b, 40 + 40 * f, 26 + 36 * b, 60 + 40 * f) for f in range(4) for b in range(4)
    ]
    floors, filled, alone = (
        inpaint(facade.image, mask, labels=facade.labels, elements=elements, model=model)
        for elements, model in ((windows, None), (windows, path), ((), path))
    )
    pane, wall = np.s_[82:98, 48:60], np.s_[112:118, 44:66]
    np.testing.assert_array_equal(filled[pane], floors[pane])
    assert error(filled[pane], facade.image[pane]) < 10, "a window as the others"
    assert error(alone[pane], facade.image[pane]) > 40, "the network alone draws none"
    assert np.ptp(filled[wall].reshape(-1, 3), axis=0).max() <= 1, "the network's one colour"


def error(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one.astype(float) - other).mean())


def test_files_that_are_no_such_networks_are_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "l.onnx"
    with pytest.raises(ModelFileError, match="no such file"):
        load_inpainting_network(path)
    path.write_bytes(b"no model")
    with pytest.raises(ModelFileError, match="not a model that onnxruntime reads"):
        load_inpainting_network(path)
    save_semantic_network(path, 19, (0, 1, 2))
    with pytest.raises(ModelFileError, match=r"its inputs are pixel_values .*, not image \[1, 3, height, width\]"):
        load_inpainting_network(path)
    save_inpainting_network(path, masks=3)
    with pytest.raises(ModelFileError, match=r"its inputs are image .*, mask \[1, 3, 'height', 'width'\]"):
        load_inpainting_network(path)


def test_a_network_that_fails_on_a_size_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save_inpainting_network(tmp_path / "l.onnx", size=("height", 64))
    with pytest.raises(ModelFileError, match="its inputs are"):
        load_inpainting_network(path)
    network = load_inpainting_network(save_inpainting_network(tmp_path / "f.onnx", size=(64, 64)))
    monkeypatch.setattr(type(network), "max_size", (32, 32))
    with pytest.raises(ModelFileError, match=r"f\.onnx: fails on a picture of 8 x 8 pixels; export it"):
        network_inpainting._run(network.network, np.zeros((8, 8, 3), np.uint8), np.zeros((8, 8), bool))
