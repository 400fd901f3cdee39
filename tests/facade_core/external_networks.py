"""Small networks with the inputs and outputs of open models, for tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper

# Logits for a difference of 1 between a channel and the mean of the others, standardised.
_STEEP = 20.0
QUERIES = 5


def _save(
    path: Path,
    nodes: Sequence[object],
    inputs: Mapping[str, Sequence[int | str]],
    outputs: Sequence[str],
    values: Mapping[str, np.ndarray],
    kind: int = TensorProto.FLOAT,
) -> Path:
    graph = helper.make_graph(
        nodes,
        "small",
        [helper.make_tensor_value_info(name, kind, shape) for name, shape in inputs.items()],
        [helper.make_tensor_value_info(name, kind, None) for name in outputs],
        [numpy_helper.from_array(value, name) for name, value in values.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    path.write_bytes(model.SerializeToString())
    return path


def save_semantic_network(
    path: Path,
    classes: int,
    by_colour: tuple[int, int, int],
    *,
    queries: bool = False,
    size: Sequence[int | str] = ("height", "width"),
    name: str = "pixel_values",
    output: str = "logits",
) -> Path:
    """Save a network that takes red, green, and blue or grey for a class each, at a quarter of the size.

    Parameters
    ----------
    classes : number of classes.
    by_colour : index of the class of each colour.
    queries : whether it answers with queries of classes and masks.
    """
    rows = QUERIES if queries else classes
    weights = np.zeros((rows, 3, 1, 1), np.float32)
    of_colour = (0, 1, 2) if queries else by_colour
    for channel, row in enumerate(of_colour):
        weights[row] -= _STEEP / 2
        weights[row, channel] += 1.5 * _STEEP
    bias = np.zeros(rows, np.float32)
    bias[of_colour[2]] = _STEEP  # grey, too
    nodes = [
        helper.make_node("AveragePool", [name], ["quarter"], kernel_shape=[4, 4], strides=[4, 4]),
        helper.make_node("Conv", ["quarter", "weights", "bias"], ["masks_queries_logits" if queries else output]),
    ]
    values, outputs = {"weights": weights, "bias": bias}, [output]
    if queries:
        bias[3:] = -_STEEP  # the others see nothing
        of_query = np.zeros((1, QUERIES, classes + 1), np.float32)
        of_query[0, range(3), by_colour] = _STEEP
        of_query[0, 3:, classes] = _STEEP
        nodes.append(helper.make_node("Identity", ["of_query"], ["class_queries_logits"]))
        values, outputs = values | {"of_query": of_query}, ["class_queries_logits", "masks_queries_logits"]
    return _save(path, nodes, {name: ["batch", 3, *size]}, outputs, values)


def save_inpainting_network(
    path: Path, *, size: Sequence[int | str] = ("height", "width"), highest: float = 1.0, masks: int = 1
) -> Path:
    """Save a network that fills the hole with the mean colour of what is visible, and darkens the visible part by half."""
    nodes = [
        helper.make_node("Sub", ["one", "mask"], ["seen"]),
        helper.make_node("Mul", ["image", "seen"], ["shown"]),
        helper.make_node("ReduceMean", ["shown"], ["total"], axes=[2, 3], keepdims=1),
        helper.make_node("ReduceMean", ["seen"], ["share"], axes=[2, 3], keepdims=1),
        helper.make_node("Div", ["total", "share"], ["mean"]),
        helper.make_node("Mul", ["mean", "mask"], ["new"]),
        helper.make_node("Mul", ["shown", "half"], ["dark"]),
        helper.make_node("Add", ["dark", "new"], ["whole"]),
        helper.make_node("Mul", ["whole", "highest"], ["output"]),
    ]
    values = {"one": np.float32(1), "half": np.float32(0.5), "highest": np.float32(highest)}
    arrays = {key: np.array(value, np.float32) for key, value in values.items()}
    return _save(path, nodes, {"image": [1, 3, *size], "mask": [1, masks, *size]}, ["output"], arrays)
