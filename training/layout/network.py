"""Architecture of the layout network: a small U-Net with attention, which sees the whole facade. Needs torch."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.facade.layout.network.raster import CHANNELS, RASTER, STRIDE

# Channels at 1/2, 1/4 and 1/8 of the raster.
WIDTHS = (48, 80, 128)
_ATTENTION_LAYERS = 4
_HEADS = 4
_DROPOUT = 0.1
# Outputs of a class in a cell: logit, and shift and size of the box.
OUTPUTS = 5


class _Residual(nn.Module):
    """Two convolutions and a shortcut."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(width, width, 3, padding=1, bias=False),
            nn.BatchNorm2d(width),
            nn.ReLU(),
            nn.Conv2d(width, width, 3, padding=1, bias=False),
            nn.BatchNorm2d(width),
            nn.Dropout2d(_DROPOUT),
        )

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(x + self.body(x))


class _Attention(nn.Module):
    """Self-attention over a sequence and a feed-forward layer, normalised before."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.before, self.between = nn.LayerNorm(width), nn.LayerNorm(width)
        self.projected, self.out = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.forward_layers = nn.Sequential(
            nn.Linear(width, 2 * width), nn.GELU(), nn.Dropout(_DROPOUT), nn.Linear(2 * width, width)
        )
        self.dropout = nn.Dropout(_DROPOUT)

    def forward(self, x: Tensor) -> Tensor:
        count, length, width = x.shape
        parts = self.projected(self.before(x)).reshape(count, length, 3, _HEADS, width // _HEADS)
        q, k, v = parts.permute(2, 0, 3, 1, 4).unbind(0)
        mixed = functional.scaled_dot_product_attention(q, k, v)
        x = x + self.dropout(self.out(mixed.permute(0, 2, 1, 3).reshape(count, length, width)))
        return x + self.dropout(self.forward_layers(self.between(x)))


class _Axial(nn.Module):
    """Attention along the rows, then along the columns, of a map."""

    def __init__(self, width: int, rows: int, columns: int) -> None:
        super().__init__()
        self.row_place = nn.Parameter(torch.zeros(1, width, rows, 1))
        self.column_place = nn.Parameter(torch.zeros(1, width, 1, columns))
        self.along_rows, self.along_columns = _Attention(width), _Attention(width)

    def forward(self, x: Tensor) -> Tensor:
        count, width, rows, columns = x.shape
        x = (x + self.row_place + self.column_place).permute(0, 2, 3, 1)
        x = self.along_rows(x.reshape(count * rows, columns, width)).reshape(count, rows, columns, width)
        x = x.permute(0, 2, 1, 3).reshape(count * columns, rows, width)
        return self.along_columns(x).reshape(count, columns, rows, width).permute(0, 3, 2, 1)


class LayoutNetwork(nn.Module):
    """Likelihood and box of a hidden element of each class in each cell.

    Input (B, CHANNELS, rows, columns); output (B, classes, OUTPUTS, rows / 2, columns / 2).
    """

    def __init__(self) -> None:
        super().__init__()
        high, middle, low = WIDTHS
        rows, columns = RASTER[0] // STRIDE, RASTER[1] // STRIDE
        self.stem = nn.Conv2d(CHANNELS * STRIDE**2, high, 3, padding=1)
        self.down_high = nn.Sequential(_Residual(high), _Residual(high))
        self.to_middle = nn.Conv2d(high, middle, 2, stride=2)
        self.down_middle = nn.Sequential(_Residual(middle), _Axial(middle, rows // 2, columns // 2))
        self.to_low = nn.Conv2d(middle, low, 2, stride=2)
        self.down_low = _Residual(low)
        self.place = nn.Parameter(torch.zeros(1, rows * columns // 16, low))
        self.attention = nn.Sequential(*(_Attention(low) for _ in range(_ATTENTION_LAYERS)))
        self.from_low = nn.Conv2d(low, middle, 1)
        self.up_middle = nn.Sequential(_Residual(middle), _Axial(middle, rows // 2, columns // 2), _Residual(middle))
        self.from_middle = nn.Conv2d(middle, high, 1)
        self.up_high = nn.Sequential(_Residual(high), _Residual(high))
        self.head = nn.Conv2d(high, len(ELEMENT_CLASSES) * OUTPUTS, 1)
        with torch.no_grad():
            self.head.weight.mul_(0.1)
            self.head.bias.zero_()
            self.head.bias.view(-1, OUTPUTS)[:, 0] = -4.0

    def forward(self, inputs: Tensor) -> Tensor:
        """Return the raw outputs."""
        high = self.down_high(functional.relu(self.stem(functional.pixel_unshuffle(inputs, STRIDE))))
        middle = self.down_middle(self.to_middle(high))
        low = self.down_low(self.to_low(middle))
        count, width, rows, columns = low.shape
        whole = self.attention(low.flatten(2).transpose(1, 2) + self.place)
        low = whole.transpose(1, 2).reshape(count, width, rows, columns)
        middle = self.up_middle(middle + functional.interpolate(self.from_low(low), scale_factor=2.0))
        high = self.up_high(high + functional.interpolate(self.from_middle(middle), scale_factor=2.0))
        raw: Tensor = self.head(high)
        return raw.reshape(count, len(ELEMENT_CLASSES), OUTPUTS, raw.shape[2], raw.shape[3])
