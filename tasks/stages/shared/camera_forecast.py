"""Forecast of stages that take surfaces from panoramas."""

from __future__ import annotations

from collections.abc import Mapping

from tasks.engine.inputs import PANORAMAS_CHANGED
from tasks.engine.stage import ForecastInputs, StageForecast


def forecast_units_after_poses(stage: str, inputs: ForecastInputs, own: Mapping[int, str]) -> StageForecast:
    """Forecast a stage that uses panoramas: all units are pending once a pose changes."""
    if inputs.pending["poses"] or inputs.pending["bundles"]:
        return StageForecast(dict.fromkeys((unit.index for unit in inputs.units[stage]), PANORAMAS_CHANGED))
    return StageForecast(own)
