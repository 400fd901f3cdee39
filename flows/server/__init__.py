"""Prefect server of a run."""
