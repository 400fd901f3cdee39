from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tasks.published.opened import Published, published


@pytest.fixture(scope="module")
def found(undisturbed: tuple[Path, dict[str, Any]]) -> Iterator[Published]:
    """What the run published that many tests look at."""
    with published(undisturbed[0]) as opened:
        yield opened
