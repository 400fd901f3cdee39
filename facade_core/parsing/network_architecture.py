"""The parser network for training: an EfficientNet-Lite0 encoder and a light decoder over strides 2 to 32.

Torch is needed here and nowhere at run time: what is trained is shipped as ONNX and run by `network`.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.nn import functional

from facade_core.core.labels import CLASSES

# One logit for each class, one for "something stands in front of the facade", one for "this is beside the facade".
OUTPUTS = len(CLASSES) + 2
# Image sides must be multiples of the coarsest stride; position is given at PLACE_STRIDE.
COARSEST, PLACE_STRIDE = 32, 8

# EfficientNet-Lite0 (Tan and Le 2019, without squeeze-and-excitation): expansion, kernel, stride, channels, repeats.
_STAGES = ((1, 3, 1, 16, 1), (6, 3, 2, 24, 2), (6, 5, 2, 40, 2), (6, 3, 2, 80, 3), (6, 5, 1, 112, 3), (6, 5, 2, 192, 4))
_LAST = (6, 3, 1, 320, 1)
_STEM = 32
_BATCH_NORM_EPSILON = 1e-3
# Blocks (by number) whose output goes to the decoder, and their channels: strides 2, 4, 8, 16 and 32.
_TAPS = {0: 16, 2: 24, 4: 40, 10: 112, 15: 320}
_WIDTH, _FINE_WIDTH = 64, 32
# Convolutions into which the export folds the normalisation that follows them, in the order of the network.
NORMALISED = (
    ("blocks.15.convolutions.2", "norms.4"),
    ("coarse.0", "coarse.1"),
    *((f"mixed.{number}.0", f"mixed.{number}.1") for number in range(3)),
    ("fine.0", "fine.1"),
)


class ParserNetwork(nn.Module):
    """(N, 3, H, W) RGB in 0..255 and (N, 2, H/8, W/8) position in -1..1 -> (N, 9, H/2, W/2) logits.

    H and W are multiples of 32. The encoder has no batch normalisation: it is folded into the convolutions when the
    ImageNet weights are read, as it would be frozen in fine-tuning with small batches anyway.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, _STEM, 3, stride=2, padding=1)
        blocks: list[nn.Module] = []
        channels = _STEM
        for expansion, kernel, stride, width, repeats in (*_STAGES, _LAST):
            for number in range(repeats):
                blocks.append(_Block(channels, width, expansion, kernel, stride if number == 0 else 1))
                channels = width
        self.blocks = nn.ModuleList(blocks)
        taps = list(_TAPS.values())
        # Encoder features spread ten times as wide as what comes from below: as they are, they drown it and the place.
        self.norms = nn.ModuleList(nn.BatchNorm2d(width) for width in taps)
        self.coarse = _mix(taps[4] + 2, _WIDTH)
        self.coarse_lines = _Lines(_WIDTH)
        self.lateral = nn.ModuleList(nn.Conv2d(width, _WIDTH, 1) for width in (taps[3] + 2, taps[2] + 2, taps[1]))
        self.mixed = nn.ModuleList(_mix(_WIDTH, _WIDTH) for _ in range(3))
        self.lines = _Lines(_WIDTH)
        self.narrow = nn.Conv2d(_WIDTH, _FINE_WIDTH, 1)
        self.fine_lateral = nn.Conv2d(taps[0], _FINE_WIDTH, 1)
        self.fine = _mix(_FINE_WIDTH, _FINE_WIDTH)
        self.head = nn.Conv2d(_FINE_WIDTH, OUTPUTS, 1)

    def forward(self, image: Tensor, place: Tensor) -> Tensor:
        x = functional.relu6(self.stem((image - 127.0) / 128.0))
        taps = []
        for number, block in enumerate(self.blocks):
            x = block(x)
            if number in _TAPS:
                taps.append(x)
        half, quarter, eighth, sixteenth, coarse = (norm(tap) for norm, tap in zip(self.norms, taps, strict=True))
        place16 = functional.avg_pool2d(place, 2)
        place32 = functional.avg_pool2d(place16, 2)
        x = self.coarse_lines(self.coarse(torch.cat([coarse, place32], 1)))
        x = self.lines(self.mixed[0](_double(x) + self.lateral[0](torch.cat([sixteenth, place16], 1))))
        x = self.mixed[1](_double(x) + self.lateral[1](torch.cat([eighth, place], 1)))
        x = self.mixed[2](_double(x) + self.lateral[2](quarter))
        x = self.fine(_double(self.narrow(x)) + self.fine_lateral(half))
        return self.head(x)

    def encoder_parameters(self) -> list[nn.Parameter]:
        return [*self.stem.parameters(), *self.blocks.parameters()]

    def first_parameters(self) -> list[nn.Parameter]:
        """Those of the encoder down to stride 4."""
        return [*self.stem.parameters(), *self.blocks[:3].parameters()]

    def read_imagenet(self, weights: Mapping[str, Tensor]) -> None:
        """Take the encoder from the state of an ImageNet classifier, batch normalisation folded in."""
        _fold(self.stem, weights, "_conv_stem", "_bn0")
        for number, block in enumerate(self.blocks):
            assert isinstance(block, _Block)
            names = ["_expand_conv", "_depthwise_conv", "_project_conv"][-len(block.convolutions) :]
            norms = ["_bn0", "_bn1", "_bn2"][-len(block.convolutions) :]
            for convolution, name, norm in zip(block.convolutions, names, norms, strict=True):
                _fold(convolution, weights, f"_blocks.{number}.{name}", f"_blocks.{number}.{norm}")


class _Block(nn.Module):
    """Inverted residual: widen, filter each channel, narrow."""

    def __init__(self, channels: int, width: int, expansion: int, kernel: int, stride: int) -> None:
        super().__init__()
        inner = channels * expansion
        depthwise = nn.Conv2d(inner, inner, kernel, stride=stride, padding=kernel // 2, groups=inner)
        widen = [nn.Conv2d(channels, inner, 1)] if expansion > 1 else []
        self.convolutions = nn.ModuleList([*widen, depthwise, nn.Conv2d(inner, width, 1)])
        self.skips = stride == 1 and channels == width

    def forward(self, x: Tensor) -> Tensor:
        y = x
        for convolution in self.convolutions[:-1]:
            y = functional.relu6(convolution(y))
        y = self.convolutions[-1](y)
        return x + y if self.skips else y


class _Lines(nn.Module):
    """Adds to each place what its row and its column show on average: windows of a floor share their lines."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.row, self.column = nn.Conv2d(width, width, 1), nn.Conv2d(width, width, 1)
        self.out = nn.Conv2d(width, width, 1)

    def forward(self, x: Tensor) -> Tensor:
        row = self.row(x.mean(3, keepdim=True))
        column = self.column(x.mean(2, keepdim=True))
        return x + self.out(functional.relu(row + column))


def _mix(channels: int, width: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels, width, 3, padding=1, bias=False), nn.BatchNorm2d(width), nn.ReLU())


def _double(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)


def _fold(convolution: nn.Module, weights: Mapping[str, Tensor], name: str, norm: str) -> None:
    assert isinstance(convolution, nn.Conv2d)
    scale = weights[f"{norm}.weight"] / torch.sqrt(weights[f"{norm}.running_var"] + _BATCH_NORM_EPSILON)
    with torch.no_grad():
        convolution.weight.copy_(weights[f"{name}.weight"] * scale[:, None, None, None])
        assert convolution.bias is not None
        convolution.bias.copy_(weights[f"{norm}.bias"] - weights[f"{norm}.running_mean"] * scale)
