"""Prefect flows and the command line: order, fan-out and barriers. No array is touched here."""
