"""A block's sun: read, part of the digest, refused below the horizon."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from catalogs.block.reader import Block
from facade_core.core.errors import BlockFileError

pytestmark = pytest.mark.long


def test_it_is_read_and_changes_the_digest(read: Callable[..., Block]) -> None:
    plain, low, high = (
        read("seed: 1"),
        *(read(f"texture: {{sun: {{azimuth: 200, elevation: {elevation}}}}}") for elevation in (20, 50)),
    )
    assert plain.texture.sun is None
    assert low.texture.sun is not None
    assert (low.texture.sun.azimuth, low.texture.sun.elevation) == (200, 20)
    assert len({plain.digest, low.digest, high.digest}) == 3
    with pytest.raises(BlockFileError, match=r"texture\.sun\.elevation"):
        read("texture: {sun: {azimuth: 200, elevation: 0}}")
    with pytest.raises(BlockFileError, match=r"texture\.sun\.elevation"):
        read("texture: {sun: {azimuth: 200}}")
