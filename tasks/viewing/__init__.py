"""Content of the viewer: a run's folder, also while the run is at work."""

from tasks.viewing.pictures import draw_stage_picture, list_stage_pictures, read_previous_capture_picture
from tasks.viewing.run_view import RunReader, RunView

__all__ = ["RunReader", "RunView", "draw_stage_picture", "list_stage_pictures", "read_previous_capture_picture"]
