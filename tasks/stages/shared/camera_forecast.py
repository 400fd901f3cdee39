"""Forecast of stages that take surfaces from panoramas."""

from __future__ import annotations

from tasks.engine.inputs import PANORAMAS_CHANGED
from tasks.engine.stage import ForecastInputs, Pending


def forecast_units_after_poses(stage: str, inputs: ForecastInputs, own: Pending) -> Pending:
    """Forecast a stage that uses panoramas: all units are pending once a pose changes."""
    if inputs.pending["poses"] or inputs.pending["bundles"]:
        return dict.fromkeys((unit.index for unit in inputs.units[stage]), PANORAMAS_CHANGED)
    return own
