"""From trained weights to the files that `network` loads, and back. Needs the `train` extra (torch, onnx)."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from facade_core.core.model_file import write_model
from facade_core.parsing.network import NETWORK_VERSION, load


def save_network(
    weights: Mapping[str, Any],
    path: Path,
    *,
    training_set: Sequence[str],
    seed: int,
    figures: Mapping[str, Any] | None = None,
) -> None:
    """Write a trained network as ONNX and, beside it, the .json that `parse` checks it against.

    training_set names the photos trained on; figures are the scores measured on photos that were not.
    """
    record = {
        "network_version": NETWORK_VERSION,
        "seed": seed,
        "training_set": list(training_set),
        "figures": dict(figures or {}),
    }
    write_model(export_onnx(weights), Path(path), record)
    load(path)


def read_weights(path: Path) -> dict[str, Any]:
    """The weights (name -> tensor) of a network's .onnx file, to go on from. What the export folded into a convolution stays
    there: its normalisation, which is the identity then, is to be left as it is. Raises ModelError as `load` does.
    """
    import onnx
    import torch

    from facade_core.parsing.network_architecture import NORMALISED, ParserNetwork

    load(path)
    graph = onnx.load(path).graph
    kept = {one.name: torch.from_numpy(onnx.numpy_helper.to_array(one).copy()) for one in graph.initializer}
    network = ParserNetwork()
    weights = network.state_dict()
    weights |= {name: value for name, value in kept.items() if name in weights}
    folded = [node.input[1:] for node in graph.node if node.op_type == "Conv" and node.input[1] not in weights]
    for (convolution, norm), (kernel, offset) in zip(NORMALISED, folded, strict=True):
        width = len(kept[offset])
        epsilon = network.get_submodule(norm).eps
        weights[f"{convolution}.weight"] = kept[kernel]
        weights |= {
            f"{norm}.weight": torch.ones(width),
            f"{norm}.bias": kept[offset],
            f"{norm}.running_mean": torch.zeros(width),
            f"{norm}.running_var": torch.full((width,), 1 - epsilon),
        }
        if f"{convolution}.bias" in weights:
            weights[f"{convolution}.bias"] = torch.zeros(width)
    return weights


def export_onnx(weights: Mapping[str, Any]) -> bytes:
    """The network with these weights as an ONNX file: inputs image (1, 3, H, W), place (1, 2, H / 8, W / 8), float32;
    output logits (1, 9, H / 2, W / 2). H and W are multiples of 32."""
    import torch

    from facade_core.parsing.network_architecture import ParserNetwork

    network = ParserNetwork()
    network.load_state_dict(weights)
    network.eval()
    content = io.BytesIO()
    size = {2: "height", 3: "width"}
    torch.onnx.export(
        network,
        (torch.zeros(1, 3, 64, 96), torch.zeros(1, 2, 8, 12)),
        content,
        input_names=["image", "place"],
        output_names=["logits"],
        dynamic_axes={"image": size, "place": {2: "h8", 3: "w8"}, "logits": {2: "h2", 3: "w2"}},
        opset_version=17,
        dynamo=False,
    )
    return content.getvalue()
