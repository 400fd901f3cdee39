"""What the viewer shows of a run's folder, whether the run has ended or is still going."""

from tasks.viewing.pictures import draw_stage_picture, read_previous_picture, list_stage_pictures
from tasks.viewing.run_view import RunReader, RunView

__all__ = ["RunReader", "RunView", "draw_stage_picture", "read_previous_picture", "list_stage_pictures"]
