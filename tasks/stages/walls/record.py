"""Records of walls and roofs from panoramas."""

from __future__ import annotations

from tasks.stages.shared.camera_record import PanoramaSurfaceRecord


class WallsAndRoofsRecord(PanoramaSurfaceRecord, total=False):
    """Record of the walls and roofs of a building."""
