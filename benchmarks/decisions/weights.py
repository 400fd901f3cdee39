"""0010: what the readings of Eq. 1 make of the views of a texel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import figures
from facade_core.street.propagation.blend import HIGH, LOW
from facade_core.street.propagation.propagate import GATE_SPACINGS

SPACING = 5.0


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """Farthest weight from the plain average, in shares of it, over texels along a spacing, of the n nearest viewpoints."""
    offsets = np.linspace(0, SPACING, 11 if quick else 501)
    counts = range(1, 11)
    return {
        "spacing_m": SPACING,
        "departure_from_plain_average": {
            "literal_all_views": {str(n): _departure(offsets, n, gated=False, mapped=False) for n in counts},
            "clamped_and_mapped_all_views": {str(n): _departure(offsets, n, gated=False, mapped=True) for n in counts},
            "gated_clamped_and_mapped": {str(n): _departure(offsets, n, gated=True, mapped=True) for n in counts},
        },
        "views_within_gate": {
            "fewest": int(min(len(_distances(o, 10, gated=True)) for o in offsets)),
            "most": int(max(len(_distances(o, 10, gated=True)) for o in offsets)),
        },
    }


def _distances(offset: float, views: int, *, gated: bool) -> np.ndarray:
    """Distances along the street in metres from a texel to its nearest viewpoints."""
    distance = np.sort(np.abs(SPACING * np.arange(-views, views + 1) - offset))[:views]
    return distance[distance <= GATE_SPACINGS * SPACING] if gated else distance


def _departure(offsets: np.ndarray, views: int, *, gated: bool, mapped: bool) -> float:
    """Largest |weight * n - 1| over the texels: 0 is the plain average, n - 1 a single view."""
    farthest = 0.0
    for offset in offsets:
        distance = _distances(float(offset), views, gated=gated)
        total = distance.sum()
        if len(distance) < 2 or total == 0:
            continue
        weight = np.clip(1 - distance / total, LOW, HIGH)
        weight = (weight - LOW) / (HIGH - LOW) if mapped else weight
        farthest = max(farthest, float(np.abs(weight / weight.sum() * len(distance) - 1).max()))
    return figures(farthest) if farthest > 1e-9 else 0.0
