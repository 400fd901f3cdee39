"""Export of trained weights to the files of `neural_translator`.

Needs the `train` extra (torch, onnx).
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from facade_core.street.translator.equirectangular_taps import TAP_COUNT
from facade_core.street.translator.neural_translator import TRANSLATOR_VERSION, load_translator, write_translator
from facade_core.street.translator.training_steps import TrainingRecipe

if TYPE_CHECKING:
    from torch import Tensor

# Smaller weights stay in single precision, because halving them saves nothing.
_MIN_HALVED_SIZE = 1024


def save_generator(
    weights: Mapping[str, Tensor], recipe: TrainingRecipe, path: Path, record: Mapping[str, object]
) -> None:
    """Write a trained generator as ONNX in half precision, with its .json record next to it."""
    write_translator(
        store_half_precision(export_generator_onnx(weights, recipe)),
        path,
        {"version": TRANSLATOR_VERSION, "width": recipe.width, **record},
    )
    load_translator(path)


def export_generator_onnx(weights: Mapping[str, Tensor], recipe: TrainingRecipe) -> bytes:
    """Export the generator as an ONNX file.

    Input seen (1, 3 TAP_COUNT, h, w) float32 in -1..1: gathered taps of rows of a whole panorama. Output rgb (1, 3, h,
    w) in -1..1. h and w are multiples of 4.
    """
    import torch
    from torch import nn

    from facade_core.street.translator.network import RESIDUAL_BLOCKS, Generator

    class Bands(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.generator = Generator(recipe.width, bands=recipe.bands, equirectangular=recipe.equirectangular)

        def forward(self, seen: torch.Tensor) -> torch.Tensor:
            return self.generator.decode(self.generator.run_blocks(seen, True, [], RESIDUAL_BLOCKS), True)

    network = Bands()
    network.generator.load_state_dict(weights)
    network.eval()
    content = io.BytesIO()
    torch.onnx.export(
        network,
        (torch.zeros(1, recipe.bands * TAP_COUNT, 16, 32),),
        content,
        input_names=["seen"],
        output_names=["rgb"],
        dynamic_axes={"seen": {2: "height", 3: "width"}, "rgb": {2: "height", 3: "width"}},
        opset_version=17,
        dynamo=False,
    )
    return content.getvalue()


def store_half_precision(content: bytes) -> bytes:
    """Store large weights in half precision; the network still computes in single precision."""
    import onnx
    from onnx import numpy_helper

    model = onnx.load_from_string(content)
    casts = []
    for weight in model.graph.initializer:
        value = numpy_helper.to_array(weight)
        if value.dtype != np.float32 or value.size < _MIN_HALVED_SIZE:
            continue
        name = weight.name
        weight.CopyFrom(numpy_helper.from_array(value.astype(np.float16), f"{name}.half"))
        casts.append(onnx.helper.make_node("Cast", [f"{name}.half"], [name], to=onnx.TensorProto.FLOAT))
    nodes = list(model.graph.node)
    del model.graph.node[:]
    model.graph.node.extend([*casts, *nodes])
    serialised: bytes = model.SerializeToString()
    return serialised
