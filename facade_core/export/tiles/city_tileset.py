"""Root tileset over the tilesets of a city's blocks, which clients load when in view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.json_types import JsonObject
from facade_core.export.attribution import Attribution


@dataclass(frozen=True)
class TilesetReference:
    """Tileset of a block.

    Attributes
    ----------
    uri : relative to the root tileset.
    sphere : (x, y, z, radius), metres of the tileset's coordinates.
    geometric_error : its geometric error, metres.
    frame : its extras on coordinates that are not earth-centred; the same in all blocks.
    """

    uri: str
    sphere: Float64Array
    geometric_error: float
    frame: Mapping[str, str] = field(default_factory=dict)


def refer_to_tileset(uri: str, tileset: JsonObject) -> TilesetReference:
    """Return the reference to a block's tileset by its document."""
    extras = tileset["asset"].get("extras", {})
    frame = {key: extras[key] for key in ("crs", "coordinates")} if "coordinates" in extras else {}
    return TilesetReference(uri, _bounding_sphere(tileset["root"]), float(tileset["geometricError"]), frame)


def build_city_tileset(
    references: Sequence[TilesetReference], name: str = "", attribution: Attribution | None = None
) -> JsonObject:
    """Build the root tileset.

    Parameters
    ----------
    references : tilesets of the blocks, at least one.
    name : name of the city; empty: not stated.
    attribution : attribution of all blocks; None: their own tilesets state it.
    """
    spheres = np.array([one.sphere for one in references])
    centre = (spheres[:, :3].min(axis=0) + spheres[:, :3].max(axis=0)) / 2
    radius = float((np.linalg.norm(spheres[:, :3] - centre, axis=1) + spheres[:, 3]).max())
    asset: JsonObject = {"version": "1.1"}
    if attribution is not None:
        extras = {"city": name, **references[0].frame, "attribution": attribution.to_json()}
        asset |= {"copyright": attribution.line, "extras": extras}
    root = {
        "boundingVolume": {"sphere": [*centre.tolist(), radius]},
        "geometricError": 2 * radius,
        "refine": "ADD",
        "children": [
            {
                "boundingVolume": {"sphere": one.sphere.tolist()},
                "geometricError": one.geometric_error,
                "content": {"uri": one.uri},
            }
            for one in references
        ],
    }
    return {"asset": asset, "geometricError": 4 * radius, "root": root}


def _bounding_sphere(root: JsonObject) -> Float64Array:
    """Compute the sphere around a tileset's root from its box and its transform, in metres."""
    box = np.array(root["boundingVolume"]["box"], float)
    transform = np.array(root.get("transform", np.eye(4).reshape(-1)), float).reshape(4, 4).T
    centre = (transform @ np.append(box[:3], 1.0))[:3]
    sphere: Float64Array = np.append(centre, np.linalg.norm(box[3:].reshape(3, 3).sum(axis=0)))
    return sphere
