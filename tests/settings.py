"""Settings of a block file for tests that need no file."""

from __future__ import annotations

from typing import Any

from catalogs.block.keys import BlockFileSettings, BuildingsSection


def block_settings(**keys: Any) -> BlockFileSettings:
    """Return settings with the defaults of a block file but these keys."""
    return BlockFileSettings(name="small", buildings=BuildingsSection(path="houses.geojson"), **keys)
