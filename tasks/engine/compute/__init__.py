"""Execution of units in this process or on a Dask cluster, with recovery from lost workers."""
