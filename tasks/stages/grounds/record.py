"""Records of ground from panoramas."""

from __future__ import annotations

from tasks.stages.shared.camera_record import PanoramaSurfaceRecord


class GroundRecord(PanoramaSurfaceRecord, total=False):
    """Record of a piece of ground."""
