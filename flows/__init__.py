"""Prefect flows and the command line: order, fan-out and barriers, without array computations."""
