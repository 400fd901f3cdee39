"""Translation network and its training networks. Needs torch.

The generator differs from the paper's. It predicts local affine colour transforms: a bilateral grid of 3 x 4 matrices over
places and brightness, computed from a small copy of the panorama and applied to the whole one. It cannot blur an edge or
move a window. Its activations are not normalised across the image, so that an output depends on its surroundings only.
Padding wraps around the panorama at +-180 degrees.

References
----------
Street paper, 3 Neural network and 4 Training.
Gharbi et al. 2017, Deep bilateral learning for real-time image enhancement.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from benchmarks.papers.translator.colour_grid import BRIGHTNESS_BINS, COEFFICIENTS, REDUCTION
from benchmarks.papers.translator.equirectangular_taps import KERNEL_SIZE, TAP_COUNT, kernel_taps
from facade_core.core.arrays import UInt8Array

RESIDUAL_BLOCKS = 3
# Encoder outputs that patches are compared at: the input, three strides, the first and the last residual block.
FEATURE_OUTPUTS = 6
_FEATURE_BLOCKS = (0, 2)
_EMBEDDING_SIZE = 256
LEAKY_SLOPE = 0.2
# Share of a residual block that is added.
RESIDUAL_SHARE = 0.2
# Factor of the last layer's initial weights, near the identity.
LAST_LAYER_SCALE = 0.05
# Largest change of an entry of a transform. Without a bound the ground turns black, which the losses take for asphalt.
MAX_CHANGE = 0.25
# Weights of the bands in the brightness of a colour.
LUMINANCE = (0.299, 0.587, 0.114)


def pad_edges(x: Tensor, margin: int, *, wraps: bool) -> Tensor:
    """Pad an image by repeated edges, or by wrapping at the left and right sides."""
    x = functional.pad(x, (margin, margin, 0, 0), mode="circular" if wraps else "replicate")
    return functional.pad(x, (0, 0, margin, margin), mode="replicate")


def _leaky_relu(x: Tensor) -> Tensor:
    return functional.leaky_relu(x, LEAKY_SLOPE)


class PaddedConvolution(nn.Module):
    """Convolution that keeps the size, or divides it by its stride."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.weights = nn.Conv2d(inputs, outputs, 3, stride)

    def forward(self, x: Tensor, wraps: bool) -> Tensor:
        """Convolve padded features (n, channels, h, w)."""
        return self.weights(pad_edges(x, 1, wraps=wraps))


class ResidualBlock(nn.Module):
    """Residual block of two convolutions that adds a fifth of its output.

    Unnormalised blocks would diverge with the full output.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first, self.second = PaddedConvolution(width, width), PaddedConvolution(width, width)

    def forward(self, x: Tensor, wraps: bool) -> Tensor:
        """Add a fifth of two convolutions of the features to them."""
        return x + RESIDUAL_SHARE * self.second(_leaky_relu(self.first(x, wraps)), wraps)


class Generator(nn.Module):
    """Generator of the translation network.

    Three convolutions of stride 2 after one on the sphere, three residual blocks, and a convolution to the grid. Inputs are
    (n, bands, h, w) in -1..1, reduced by REDUCTION from the images that the grid is applied to. `equirectangular` places the
    taps of the first convolution on the sphere. `place` then gives each input's first row and panorama height. `wraps`: the
    inputs are whole bands of a panorama.
    """

    def __init__(self, width: int, *, bands: int = 4, equirectangular: bool = True) -> None:
        super().__init__()
        self.width, self.bands, self.equirectangular = width, bands, equirectangular
        self.first = nn.Conv2d(bands * TAP_COUNT, width, 1)
        self.narrowing = nn.ModuleList(
            [
                PaddedConvolution(width, 2 * width, 2),
                PaddedConvolution(2 * width, 4 * width, 2),
                PaddedConvolution(4 * width, 4 * width, 2),
            ]
        )
        self.blocks = nn.ModuleList([ResidualBlock(4 * width) for _ in range(RESIDUAL_BLOCKS)])
        self.last = PaddedConvolution(4 * width, COEFFICIENTS * BRIGHTNESS_BINS)

    def forward(self, x: Tensor, place: Sequence[tuple[int, int]], wraps: bool = False) -> Tensor:
        """Predict the grids of a batch, (n, COEFFICIENTS, BRIGHTNESS_BINS, h / 8, w / 8)."""
        return self.decode(self.run_blocks(self.gather_inputs(x, place), wraps, []), wraps)

    def gather_inputs(self, x: Tensor, place: Sequence[tuple[int, int]]) -> Tensor:
        """Gather the taps of the first convolution, (n, bands * TAP_COUNT, h, w)."""
        if not self.equirectangular:
            padded = pad_edges(x, KERNEL_SIZE // 2, wraps=False)
            return functional.unfold(padded, KERNEL_SIZE).view(len(x), -1, *x.shape[2:])
        return torch.cat(
            [_gather_image(image[None], *row_and_height) for image, row_and_height in zip(x, place, strict=True)]
        )

    def run_blocks(self, entry: Tensor, wraps: bool, features: list[Tensor]) -> Tensor:
        """Run the network up to the last residual block.

        Appends the outputs that patches are compared at to `features`.
        """
        x = _leaky_relu(self.first(entry))
        for layer in self.narrowing:
            x = _leaky_relu(layer(x, wraps))
            features.append(x)
        for number, block in enumerate(self.blocks):
            x = block(x, wraps)
            if number in _FEATURE_BLOCKS:
                features.append(x)
        return x

    def decode(self, x: Tensor, wraps: bool) -> Tensor:
        """Decode the residual blocks' output to the grid of transforms."""
        offsets = self.last(x, wraps)
        grid = offsets.reshape(x.shape[0], COEFFICIENTS, BRIGHTNESS_BINS, *offsets.shape[2:])
        identity = torch.eye(3, 4, device=x.device, dtype=grid.dtype).reshape(1, COEFFICIENTS, 1, 1, 1)
        return identity + MAX_CHANGE * torch.tanh(grid)

    def encode(self, x: Tensor, place: Sequence[tuple[int, int]]) -> list[Tensor]:
        """Return features at the FEATURE_OUTPUTS outputs."""
        features = [x]
        self.run_blocks(self.gather_inputs(x, place), False, features)
        return features


def reduce_image(x: Tensor) -> Tensor:
    """Reduce images (n, bands, h, w) by REDUCTION, as the network sees them."""
    return functional.avg_pool2d(x, REDUCTION)


def apply_grid(grid: Tensor, image: Tensor) -> Tensor:
    """Apply grids of transforms to images (n, 3, h, w) in -1..1; edges of the images do not wrap."""
    height, width = image.shape[2:]
    weights = torch.tensor(LUMINANCE, device=image.device, dtype=image.dtype).reshape(1, 3, 1, 1)
    brightness = (image * weights).sum(1)
    y = ((torch.arange(height, device=image.device) + 0.5) / height * 2 - 1)[None, :, None].expand_as(brightness)
    x = ((torch.arange(width, device=image.device) + 0.5) / width * 2 - 1)[None, None].expand_as(brightness)
    where = torch.stack([x, y, brightness], -1)[:, None].to(grid.dtype)
    matrices = functional.grid_sample(grid, where, mode="bilinear", padding_mode="border", align_corners=False)
    matrices = matrices[:, :, 0].reshape(len(image), 3, 4, height, width)
    return (matrices[:, :, :3] * image[:, None]).sum(2) + matrices[:, :, 3]


def _gather_image(image: Tensor, top: int, panorama_height: int) -> Tensor:
    """Gather the taps of one image (1, bands, h, w), part of a panorama from row `top` on."""
    _, bands, height, width = image.shape
    rows, columns = (
        torch.from_numpy(part[top : top + height]).to(image.device) for part in kernel_taps(panorama_height)
    )
    # grid in -1..1 over the image's outer edges: (h * TAP_COUNT, w)
    y = ((rows - top + 0.5) / height * 2 - 1)[..., None].expand(height, TAP_COUNT, width)
    across = torch.arange(width, device=image.device)
    x = (columns[..., None] + across + 0.5) / width * 2 - 1
    grid = torch.stack([x, y], -1).reshape(1, height * TAP_COUNT, width, 2).to(image.dtype)
    seen = functional.grid_sample(image, grid, mode="bilinear", padding_mode="border", align_corners=False)
    return (
        seen.reshape(bands, height, TAP_COUNT, width).permute(0, 2, 1, 3).reshape(1, bands * TAP_COUNT, height, width)
    )


class Discriminator(nn.Module):
    """PatchGAN discriminator: scores (n, 1, rows, columns) of overlapping patches of 70 pixels.

    Activations are not normalised, because that would hide the mean colour that is compared.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.Conv2d(3, width, 4, 2, 1), nn.LeakyReLU(0.2)]
        for inputs, outputs, stride in ((1, 2, 2), (2, 4, 2), (4, 8, 1)):
            layers += [nn.Conv2d(inputs * width, outputs * width, 4, stride, 1), nn.LeakyReLU(0.2)]
        self.layers = nn.Sequential(*layers, nn.Conv2d(8 * width, 1, 4, 1, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Return the scores of overlapping patches of images (n, 3, h, w)."""
        return self.layers(x)


class PatchEmbedding(nn.Module):
    """Embedding of features as unit vectors: two layers for each of the FEATURE_OUTPUTS outputs."""

    def __init__(self, width: int, bands: int = 4) -> None:
        super().__init__()
        sizes = (bands, 2 * width, *(4 * width,) * (FEATURE_OUTPUTS - 2))
        self.layers = nn.ModuleList(
            [
                nn.Sequential(nn.Linear(n, _EMBEDDING_SIZE), nn.ReLU(), nn.Linear(_EMBEDDING_SIZE, _EMBEDDING_SIZE))
                for n in sizes
            ]
        )

    def forward(self, features: Sequence[Tensor], where: Sequence[Tensor]) -> list[Tensor]:
        """Return unit vectors (n, patches, 256) at flat positions `where` of each output."""
        embeddings = []
        for layer, feature, chosen in zip(self.layers, features, where, strict=True):
            flat = feature.flatten(2).permute(0, 2, 1)[:, chosen]
            embeddings.append(functional.normalize(layer(flat), dim=-1))
        return embeddings


def initialise_weights(network: nn.Module, generator: torch.Generator) -> None:
    """Initialise weights that keep the spread of activations; a generator starts near the identity."""
    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.Linear):
            nn.init.kaiming_normal_(layer.weight, a=LEAKY_SLOPE, generator=generator)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)
    if isinstance(network, Generator):
        with torch.no_grad():
            network.last.weights.weight.mul_(LAST_LAYER_SCALE)


def image_to_tensor(image: UInt8Array) -> Tensor:
    """Convert (h, w, bands) or (n, h, w, bands) uint8 to (n, bands, h, w) in -1..1."""
    batch = image if image.ndim == 4 else image[None]
    return torch.from_numpy(np.ascontiguousarray(batch)).permute(0, 3, 1, 2).float() / 127.5 - 1
