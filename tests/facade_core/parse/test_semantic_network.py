"""Occluders and surroundings by a semantic network of a user, within the parse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.painter.facade import paint_facade
from facade_core.core.errors import ModelFileError
from facade_core.core.types import TrainedModelFiles
from facade_core.imagery.rectify.building_crop import crop_to_building
from facade_core.parsing import semantic_classes as tables
from facade_core.parsing.segmenter import parse, segment_surroundings
from facade_core.parsing.semantic_network import load_semantic_network

pytest.importorskip("onnx", reason="onnx is absent: make setup")

from tests.facade_core.external_networks import save_inpainting_network, save_semantic_network

# Numbers of classes and, as the data sets list them, an occluder, what is outside, and a building.
DATA_SETS = {19: (13, 0, 2), 150: (4, 6, 1), 65: (45, 13, 17), 66: (45, 13, 17), 124: (85, 21, 27)}
HEIGHT, WIDTH = 400, 320
NOTHING = np.zeros((HEIGHT, WIDTH), bool)


def three_colours() -> np.ndarray:
    """Blue: building; a red post before it; green: ground at the foot."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    image[..., 2] = 255
    image[100:360, 140:180] = (255, 0, 0)
    image[360:] = (0, 255, 0)
    return image


@pytest.mark.parametrize("queries", [False, True])
@pytest.mark.parametrize("size", [("height", "width"), (256, 512)])
@pytest.mark.parametrize("count", DATA_SETS)
def test_occluders_and_ground_are_those_of_the_network(
    tmp_path: Path, count: int, size: tuple[int | str, ...], queries: bool
) -> None:
    path = save_semantic_network(tmp_path / "n.onnx", count, DATA_SETS[count], queries=queries, size=size)
    models = TrainedModelFiles(segmentation=path)
    image = three_colours()
    shipped, found = parse(image), parse(image, model=models)
    np.testing.assert_array_equal(found.labels, shipped.labels)
    np.testing.assert_array_equal(found.confidence, shipped.confidence)
    post = np.zeros_like(NOTHING)
    post[100:360, 140:180] = True
    assert found.occluded[110:350, 148:172].all()
    assert (found.occluded != post).mean() < 0.03
    surroundings = segment_surroundings(image, NOTHING, model=models)
    assert surroundings.outside[368:].all()
    assert (surroundings.outside | ~segment_surroundings(image, NOTHING).outside).all(), "joined with the parser's"


def test_the_parser_no_longer_decides_occluders(tmp_path: Path) -> None:
    painted = paint_facade(
        (12.0, 12.0), floors=4, columns=4, style="haussmann", metres_per_pixel=0.03, occluders=3, seed=2
    )
    assert parse(painted.image).occluded.mean() > 0.05
    buildings = save_semantic_network(tmp_path / "n.onnx", 19, (2, 2, 2))
    assert not parse(painted.image, model=TrainedModelFiles(segmentation=buildings)).occluded.any()


def test_a_photo_is_cropped_with_the_networks_occluders(tmp_path: Path) -> None:
    painted = paint_facade((12.0, 12.0), floors=4, columns=4, style="haussmann", metres_per_pixel=0.03, seed=2)
    image = painted.image.copy()
    height, width = image.shape[:2]
    image[height // 2 :, width // 2 : width // 2 + 30] = (255, 0, 0)
    network = save_semantic_network(tmp_path / "n.onnx", 19, (5, 2, 2))
    hidden = np.zeros(image.shape[:2], bool)
    cut = crop_to_building(image, hidden, width / 2, None, is_day=True, model=TrainedModelFiles(segmentation=network))
    occluder = cut.segmentation.occluder
    rows, columns = occluder.shape
    assert occluder[3 * rows // 4, round((width / 2 + 15) / width * columns)] > 0.9


@pytest.mark.parametrize("shape", [(1, 1), (3, 2), (5, 4000), (2300, 40)])
def test_small_and_narrow_images(tmp_path: Path, shape: tuple[int, int]) -> None:
    network = save_semantic_network(tmp_path / "n.onnx", 19, (13, 0, 2))
    image = np.random.default_rng(1).integers(0, 256, (*shape, 3), dtype=np.uint8)
    assert parse(image, model=TrainedModelFiles(segmentation=network)).occluded.shape == shape


def test_the_tables_list_each_class_of_a_data_set_once() -> None:
    counts = {19: tables._CITYSCAPES, 150: tables._ADE20K, 66: tables._MAPILLARY_1, 124: tables._MAPILLARY_2}
    for count, table in counts.items():
        assert len(set(table.split())) == count
    one, other = tables.CLASSES_BY_COUNT[65], tables.CLASSES_BY_COUNT[66]
    assert one == other, "without a role, `unlabeled` changes nothing"


def test_files_that_are_no_such_networks_are_refused_in_one_line(tmp_path: Path) -> None:
    def refusal(path: Path) -> str:
        with pytest.raises(ModelFileError) as caught:
            load_semantic_network(path)
        message = str(caught.value)
        assert str(path) in message
        assert "\n" not in message
        return message

    path = tmp_path / "n.onnx"
    assert "no such file" in refusal(path)
    path.write_bytes(b"no model")
    assert "not a model that onnxruntime reads" in refusal(path)
    save_semantic_network(path, 21, (0, 1, 2))
    assert "has 21 classes; give a network of Cityscapes (19), ADE20K (150)" in refusal(path)
    save_semantic_network(path, 19, (0, 1, 2), name="input")
    assert "its inputs are input ['batch', 3, 'height', 'width'] tensor(float), not pixel_values" in refusal(path)
    save_semantic_network(path, 19, (0, 1, 2), output="output")
    assert "its outputs are output (1, 19, 64, 64) float32, not logits" in refusal(path)
    save_inpainting_network(path)
    assert "not pixel_values [1, 3, height, width]" in refusal(path)
