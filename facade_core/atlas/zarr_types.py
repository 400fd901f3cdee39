"""Names for zarr's groups and arrays in signatures.

zarr types the items of both as unions too wide to be of use to a checker, so these are Any to it.
"""

from __future__ import annotations

from typing import Any

StoreGroup = Any  # zarr.Group
StoreArray = Any  # zarr.Array
