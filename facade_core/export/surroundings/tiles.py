"""Surroundings of a block as a tile of 3D Tiles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from facade_core.export.surroundings.gltf import SurroundingModel, encode_surroundings_glb, surrounding_bounds
from facade_core.export.tiles.tileset import BoundingVolume, Tile, bounding_box, box_corners, z_up_bounds


def write_surroundings_tile(
    root: Tile, model: SurroundingModel, copyright: str, write: Callable[[str, bytes], None]
) -> None:
    """Write the model of surroundings, if any, and add its tile to the root of a tileset.

    Parameters
    ----------
    root : root tile; its box grows.
    model : the surroundings in the frame of the tileset.
    copyright : attribution.
    write : receives the path, relative to the tileset, and the bytes of a file.
    """
    if model.is_empty:
        return
    uri = "tiles/surroundings.glb"
    write(uri, encode_surroundings_glb(model, {}, copyright))
    corners = np.stack(np.meshgrid(*surrounding_bounds(model).T, indexing="ij"), axis=-1).reshape(-1, 3)
    bounds = z_up_bounds([model.frame.points(corners)])
    volume: BoundingVolume = {"box": bounding_box(bounds)}
    root["boundingVolume"] = {"box": bounding_box(np.concatenate([box_corners(root), bounds]))}
    root.setdefault("children", []).append({"boundingVolume": volume, "geometricError": 0.0, "content": {"uri": uri}})
