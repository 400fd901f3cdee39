"""Facade layouts: grids, statistical model and completion (layout paper)."""
