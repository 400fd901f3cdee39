"""0006: how much of a street's atlas no viewpoint sees, and what storing a fill for it would add."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from benchmarks.decisions.texels import street_scene
from benchmarks.timing import bytes_in, figures
from facade_core.atlas.rasters import write_rasters
from facade_core.core.provenance import Provenance
from facade_core.geometry.charts import KINDS
from facade_core.geometry.scene import Scene
from facade_core.geometry.streets import Viewpoint
from facade_core.street.propagation.propagate import propagate
from facade_core.street.propagation.texel_buffer import TexelBuffer

PANORAMA = 1024


def measure(quick: bool, data: Path | None) -> dict[str, Any]:
    """A street of houses on both sides, a viewpoint every 5 m: texels without a view, and bytes with and without a fill."""
    scene, middle = street_scene(2 if quick else 12)
    rasters, writable = TexelBuffer.layout(scene.placement, range(len(scene.charts)), [])
    blank = np.zeros((rasters.total, 3), np.uint8)
    window = TexelBuffer.of(scene.placement, rasters, writable, blank, blank[:, 0].copy())
    noise = np.random.default_rng(0).integers(0, 256, (PANORAMA // 2, PANORAMA, 3), dtype=np.uint8)
    for number, x in enumerate(np.arange(scene.spacing / 2, 2 * middle.position[0], scene.spacing)):
        position = np.array([x, *middle.position[1:]])
        propagate(scene, window, Viewpoint(number, 0, position, middle.forward), noise)
    unseen = window.provenance == Provenance.UNSEEN
    kind = np.repeat(scene.charts.kind, scene.placement.width.astype(np.int64) * scene.placement.height)
    filled = np.where(unseen[:, None], np.random.default_rng(1).integers(0, 256, (1, 3)), window.colour)
    stored = {
        "as_seen": _stored_mb(scene, rasters, window.colour),
        "with_flat_fill": _stored_mb(scene, rasters, filled.astype(np.uint8)),
        "with_textured_fill": _stored_mb(scene, rasters, _textured(filled, unseen)),
    }
    return {
        "texels": rasters.total,
        "unseen": figures(float(unseen.mean())),
        "unseen_by_kind": {
            name: figures(float(unseen[kind == k].mean())) for k, name in enumerate(KINDS) if (kind == k).any()
        },
        "stored_mb": stored,
    }


def _textured(filled: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """The fill with the grain of a material, which does not compress."""
    grain = np.random.default_rng(2).integers(0, 32, filled.shape)
    return np.where(unseen[:, None], np.minimum(filled + grain, 255), filled).astype(np.uint8)


def _stored_mb(scene: Scene, rasters: Any, colour: np.ndarray) -> float:
    spec = scene.spec
    with tempfile.TemporaryDirectory() as folder:
        array: Any = zarr.create_array(
            folder,
            shape=(spec.pages, spec.page, spec.page, 3),
            chunks=(1, spec.chunk, spec.chunk, 3),
            dtype="uint8",
            fill_value=0,
        )
        write_rasters(array, spec, scene.placement, rasters, colour)
        return figures(bytes_in(Path(folder)) / 1e6)
