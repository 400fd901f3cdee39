"""Export of trained weights to the files that `network` loads, and back. Needs the `train` extra (torch, onnx)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from facade_core.parsing.network import NETWORK_VERSION, load_network
from training.model_files import write_model
from training.torch_files import encode_onnx

if TYPE_CHECKING:
    from torch import Tensor


def save_network(
    weights: Mapping[str, Tensor],
    path: Path,
    *,
    training_set: Sequence[str],
    seed: int,
    figures: Mapping[str, object] | None = None,
) -> None:
    """Write a trained network as ONNX, with the .json that `parse` checks it against.

    Parameters
    ----------
    weights : name -> tensor.
    path : .onnx file to write.
    training_set : names of the training photos.
    seed : random seed of the training.
    figures : scores measured on other photos.
    """
    record = {
        "network_version": NETWORK_VERSION,
        "seed": seed,
        "training_set": list(training_set),
        "figures": dict(figures or {}),
    }
    write_model(export_onnx(weights), Path(path), record)
    load_network(path)


def read_weights(path: Path) -> dict[str, Tensor]:
    """Read the weights (name -> tensor) of a network's .onnx file, to continue its training.

    Normalisation that the export folded into a convolution stays there. It is the identity here and must stay frozen.

    Raises
    ------
    ModelError
        As in `load_network`.
    """
    import onnx
    import torch

    from training.parser.network import FOLDED_NORMS, ParserNetwork

    load_network(path)
    graph = onnx.load(path).graph
    initializers = {
        tensor.name: torch.from_numpy(onnx.numpy_helper.to_array(tensor).copy()) for tensor in graph.initializer
    }
    network = ParserNetwork()
    weights: dict[str, Tensor] = network.state_dict()
    weights |= {name: value for name, value in initializers.items() if name in weights}
    folded = [node.input[1:] for node in graph.node if node.op_type == "Conv" and node.input[1] not in weights]
    for (convolution, norm), (kernel, offset) in zip(FOLDED_NORMS, folded, strict=True):
        width = len(initializers[offset])
        epsilon = network.get_submodule(norm).eps
        weights[f"{convolution}.weight"] = initializers[kernel]
        weights |= {
            f"{norm}.weight": torch.ones(width),
            f"{norm}.bias": initializers[offset],
            f"{norm}.running_mean": torch.zeros(width),
            f"{norm}.running_var": torch.full((width,), 1 - epsilon),
        }
        if f"{convolution}.bias" in weights:
            weights[f"{convolution}.bias"] = torch.zeros(width)
    return weights


def export_onnx(weights: Mapping[str, Tensor]) -> bytes:
    """Export a network with these weights as the bytes of an ONNX file.

    Its inputs are image (1, 3, H, W) and place (1, 2, H / 8, W / 8), float32; its output is logits (1, 9, H / 2, W /
    2). H and W are multiples of 32.
    """
    import torch

    from training.parser.network import ParserNetwork

    network = ParserNetwork()
    network.load_state_dict(weights)
    network.eval()
    return encode_onnx(
        network,
        {"image": torch.zeros(1, 3, 64, 96), "place": torch.zeros(1, 2, 8, 12)},
        ["logits"],
        {"image": {2: "height", 3: "width"}, "place": {2: "h8", 3: "w8"}, "logits": {2: "h2", 3: "w2"}},
    )
