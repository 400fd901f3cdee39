"""Records of ground from panoramas."""

from __future__ import annotations

from tasks.stages.shared.camera_record import CameraRecord


class GroundRecord(CameraRecord, total=False):
    """Record of a piece of ground."""
