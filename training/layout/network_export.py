"""Export of a trained layout network to the files that completion loads. Needs the `train` extra (torch, onnx)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from facade_core.facade.layout.network.raster import CHANNELS, RASTER
from facade_core.facade.layout.network.windows import load_layout_network
from training.model_files import write_model
from training.torch_files import encode_onnx

if TYPE_CHECKING:
    from torch import Tensor


def save_layout_network(weights: Mapping[str, Tensor], path: Path, *, training_set: Sequence[str], seed: int) -> None:
    """Write a trained network as ONNX, with the .json that it is checked against.

    Parameters
    ----------
    weights : name -> tensor.
    path : .onnx file to write.
    training_set : names of the training layouts.
    seed : random seed of the training.
    """
    import torch

    from training.layout.network import LayoutNetwork

    network = LayoutNetwork()
    network.load_state_dict(weights)
    network.eval()
    content = encode_onnx(network, {"layout": torch.zeros(1, CHANNELS, *RASTER)}, ["raw"])
    write_model(content, path, {"seed": seed, "training_set": list(training_set)})
    load_layout_network(path)
