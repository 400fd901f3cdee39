import json

import numpy as np
import pytest

from facade_core.core.errors import ModelFileError
from facade_core.core.labels import CLASSES, FacadeClass
from facade_core.parsing import network
from facade_core.parsing.elements import elements
from facade_core.parsing.segmenter import parse
from training.model_files import write_model

pytest.importorskip("onnx", reason="onnx is absent: make setup")

from onnx import TensorProto, helper, numpy_helper

RECORD = {"network_version": network.NETWORK_VERSION, "training_set": []}


def tiny_network(inputs=("image", "place"), steep=1.0):
    """Mean of 2 x 2 pixels, then: red speaks for wall, green for roof and for outside, blue for something in front; the place
    across speaks for sky, weakly and only so that it is used."""
    outputs = len(CLASSES) + 2
    weights = np.zeros((outputs, 3, 1, 1), np.float32)
    (
        weights[FacadeClass.WALL, 0],
        weights[[FacadeClass.ROOF, network.OUTSIDE_OUTPUT], 1],
        weights[network.OCCLUDER_OUTPUT, 2],
    ) = (
        steep,
        steep,
        steep,
    )
    bias = np.zeros(outputs, np.float32)
    bias[[network.OCCLUDER_OUTPUT, network.OUTSIDE_OUTPUT]] = -128 * steep
    aside = np.zeros((outputs, 2, 1, 1), np.float32)
    nodes = [
        helper.make_node("AveragePool", [inputs[0]], ["half"], kernel_shape=[2, 2], strides=[2, 2]),
        helper.make_node("Conv", ["half", "weights", "bias"], ["colour"]),
        helper.make_node("Conv", [inputs[1], "aside"], ["small"]),
        helper.make_node("Resize", ["small", "", "scales"], ["wide"]),
        helper.make_node("Add", ["colour", "wide"], ["logits"]),
    ]
    values = {"weights": weights, "bias": bias, "aside": aside, "scales": np.array([1, 1, 4, 4], np.float32)}
    graph = helper.make_graph(
        nodes,
        "tiny",
        [
            helper.make_tensor_value_info(inputs[0], TensorProto.FLOAT, [1, 3, "h", "w"]),
            helper.make_tensor_value_info(inputs[1], TensorProto.FLOAT, [1, 2, "h8", "w8"]),
        ],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, [1, outputs, "h2", "w2"])],
        [numpy_helper.from_array(value, name) for name, value in values.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    return model.SerializeToString()


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "tiny.onnx"
    write_model(tiny_network(), path, RECORD)
    return path


def two_colours(height=320, width=256):
    image = np.zeros((height, width, 3), np.uint8)
    image[: height // 2, :, 1], image[height // 2 :, :, 0] = 200, 200
    return image


def test_a_network_parses_through_the_same_door(model):
    image = two_colours()
    found = parse(image, model=model)
    assert (found.labels[:156] == FacadeClass.ROOF).all()
    assert (found.labels[164:] == FacadeClass.WALL).all()
    np.testing.assert_allclose(found.confidence.sum(2), 1, atol=1e-5)
    assert found.confidence.dtype == np.float32
    assert not found.occluded.any()


def test_the_doors_weight_in_training_is_taken_back(model):
    confidence = network.load_network(model).segment(np.zeros((64, 96, 3), np.uint8)).confidence
    shares = np.ones(len(CLASSES))
    shares[FacadeClass.DOOR] /= network.DOOR_WEIGHT
    np.testing.assert_allclose(confidence, np.broadcast_to(shares / shares.sum(), confidence.shape), atol=1e-5)


def test_what_stands_in_front_is_occluded_and_no_observation(model):
    image = two_colours()
    image[200:260, 60:200] = (0, 0, 255)
    found = parse(image, model=model)
    assert found.occluded[210:250, 70:190].all()
    assert found.occluded.mean() == pytest.approx(60 * 140 / image[..., 0].size, rel=0.15)
    alpha = np.full(image.shape[:2], 255, np.uint8)
    alpha[:40] = 0
    both = parse(np.dstack([image, alpha]), model=model)
    assert both.occluded[:40].all()
    assert both.occluded[210:250, 70:190].all()
    assert all(element.y0 < 250 for element in elements(both))


def test_a_mirrored_image_has_the_mirrored_parse(model):
    rng = np.random.default_rng(0)
    image = np.kron(rng.integers(0, 2, (10, 8, 3)), np.ones((40, 32, 1))).astype(np.uint8) * 200
    plain, mirrored = parse(image, model=model), parse(image[:, ::-1].copy(), model=model)
    np.testing.assert_allclose(plain.confidence, mirrored.confidence[:, ::-1], atol=1e-4)


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (3, 2), (5, 4000), (2300, 40)])
def test_small_and_narrow_images(model, shape):
    image = np.random.default_rng(1).integers(0, 256, (*shape, 3), dtype=np.uint8)
    found = parse(image, model=model)
    assert found.labels.shape == found.occluded.shape == shape
    np.testing.assert_allclose(found.confidence.sum(2), 1, atol=1e-5)


def test_large_images_are_parsed_at_working_size(model):
    image = np.repeat(np.repeat(two_colours(), 12, 0), 12, 1)  # 11.8 megapixels
    found = parse(image, model=model)
    assert (found.labels[: 12 * 156] == FacadeClass.ROOF).all()
    assert (found.labels[12 * 164 :] == FacadeClass.WALL).all()


def test_logits_of_any_size_give_probabilities(tmp_path):
    path = tmp_path / "steep.onnx"
    write_model(tiny_network(steep=1e4), path, RECORD)
    found = parse(two_colours(), model=path)
    assert np.isfinite(found.confidence).all()


def test_places_run_over_the_whole_image():
    place = network.cell_position_planes(64, 32, np.array([-1, -1, 1, 1]))
    assert place.shape == (2, 8, 4)
    np.testing.assert_allclose(place[0, 0], [-0.75, -0.25, 0.25, 0.75])
    np.testing.assert_allclose(place[1, :, 0], np.linspace(-0.875, 0.875, 8))


def test_networks_of_other_versions_and_shapes_are_refused(tmp_path, model):
    record = json.loads(model.with_suffix(".json").read_text())
    model.with_suffix(".json").write_text(json.dumps(record | {"network_version": 0}))
    with pytest.raises(ModelFileError, match="another version"):
        parse(two_colours(), model=model)
    other = tmp_path / "other.onnx"
    write_model(tiny_network(("picture", "place")), other, RECORD)
    with pytest.raises(ModelFileError, match="picture"):
        parse(two_colours(), model=other)
    with pytest.raises(ModelFileError, match="no such file"):
        network.load_network(tmp_path / "none.onnx")


def test_threads_of_the_network_do_not_spin_while_they_wait() -> None:
    options = network.load_network(network.SHIPPED_NETWORK).session.get_session_options()
    assert options.get_session_config_entry("session.intra_op.allow_spinning") == "0"
