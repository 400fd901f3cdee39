"""Georeference of a published block's 3D Tiles."""

from __future__ import annotations

from facade_core.core.arrays import Float64Array
from facade_core.export.tiles.earth import ProjectedFrame, TilesetFrame, earth_tangent_frame
from tasks.publish.published_run import PublishedBlock

# Value of --crs for tiles in the block's projected CRS instead of the earth-centred frame.
NATIVE_CRS = "native"


def georeference_tiles(
    results: PublishedBlock, origin: Float64Array, crs: str | None = None
) -> tuple[TilesetFrame, dict[str, object], list[str]]:
    """Compute the frame of a block's tiles.

    Parameters
    ----------
    results : published results of a block.
    origin : (3,) origin of the tiles, world metres.
    crs : NATIVE_CRS: the block's own, with its own heights; None: earth-centred (EPSG:4978).

    Returns
    -------
    frame : transform to the coordinates of the tileset.
    extras : facts for the tileset.
    notes : remarks for the user.
    """
    separation = results.group.attrs.get("geoid_separation")
    extras: dict[str, object] = {"block": results.block, "crs": results.crs, "snapshot": results.snapshot.id}
    if crs == NATIVE_CRS:
        extras["coordinates"] = f"metres of {results.crs}: x east, y north, z up; not earth-centred"
        extras["heights"] = "the block's own, as given"
        return ProjectedFrame(origin), extras, []
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
