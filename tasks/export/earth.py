"""Georeference of a published block's 3D Tiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from facade_core.core.arrays import Float64Array
from tasks.publish.published_run import PublishedBlock

if TYPE_CHECKING:
    from facade_core.export.tiles.earth import EarthTangentFrame


def georeference_tiles(
    results: PublishedBlock, origin: Float64Array
) -> tuple[EarthTangentFrame, dict[str, object], list[str]]:
    """Compute the earth frame of a block's tiles.

    Parameters
    ----------
    results : published results of a block.
    origin : (3,) origin of the tiles, world metres.

    Returns
    -------
    frame : transform to earth-centred coordinates.
    extras : facts for the tileset.
    notes : remarks for the user.
    """
    from facade_core.export.tiles.earth import earth_tangent_frame

    separation = results.group.attrs.get("geoid_separation")
    extras: dict[str, object] = {"block": results.block, "crs": results.crs, "snapshot": results.snapshot.id}
    if separation is None:
        extras["heights"] = (
            "the block's own, as given: without geoid_separation in the block file they may not be over the ellipsoid"
        )
        notes = [
            "heights are the block's own, and 3D Tiles count them from the ellipsoid: the model may stand tens of metres too "
            "high or too low; write geoid_separation: auto, or its metres, in the block file and run it again"
        ]
    else:
        extras["heights"] = f"over the ellipsoid: {separation} m added to the block's"
        notes = []
    return earth_tangent_frame(results.crs, origin, separation or 0.0), extras, notes
