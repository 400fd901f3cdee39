"""What the viewer shows of a run's folder, whether the run has ended or is still going."""

from tasks.viewing.pictures import picture, picture_before, stages
from tasks.viewing.run_view import RunReader, RunView

__all__ = ["RunReader", "RunView", "picture", "picture_before", "stages"]
