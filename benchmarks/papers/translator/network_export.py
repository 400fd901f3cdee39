"""Export of trained weights to the files of `neural_translator`.

Needs the `train` extra (torch, onnx).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.papers.translator.colour_grid import NETWORK_HEIGHT
from benchmarks.papers.translator.equirectangular_taps import TAP_COUNT
from benchmarks.papers.translator.neural_translator import TRANSLATOR_VERSION, load_colour_network, write_translator
from benchmarks.papers.translator.steps import TrainingRecipe
from training.torch_files import encode_onnx

if TYPE_CHECKING:
    from torch import Tensor


def save_generator(
    weights: Mapping[str, Tensor], recipe: TrainingRecipe, path: Path, record: Mapping[str, object]
) -> None:
    """Write a trained generator as ONNX, with its .json record next to it."""
    write_translator(
        export_generator_onnx(weights, recipe),
        path,
        {"version": TRANSLATOR_VERSION, "width": recipe.width, **record},
    )
    load_colour_network(path)


def export_generator_onnx(weights: Mapping[str, Tensor], recipe: TrainingRecipe) -> bytes:
    """Export the generator as an ONNX file.

    Input seen (1, bands * TAP_COUNT, NETWORK_HEIGHT, 2 * NETWORK_HEIGHT) float32: gathered taps of a whole panorama in -1..1.
    Output grid (1, COEFFICIENTS, BRIGHTNESS_BINS, rows, columns).
    """
    import torch
    from torch import nn

    from benchmarks.papers.translator.network import Generator

    class Panorama(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.generator = Generator(recipe.width, bands=recipe.bands, equirectangular=recipe.equirectangular)

        def forward(self, seen: torch.Tensor) -> torch.Tensor:
            return self.generator.decode(self.generator.run_blocks(seen, True, []), True)

    network = Panorama()
    network.generator.load_state_dict(weights)
    network.eval()
    seen = torch.zeros(1, recipe.bands * TAP_COUNT, NETWORK_HEIGHT, 2 * NETWORK_HEIGHT)
    return encode_onnx(network, {"seen": seen}, ["grid"])
