"""Which formats can be written here: those that ask for a package that is not installed are left out, and named."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import pytest

from tasks.export.formats import FORMATS

WITHOUT_USD = pytest.mark.skipif(find_spec("pxr") is None, reason="no usd-core here; `make usd-setup` installs it")
# For parametrize: every format.
EACH: list[Any] = [pytest.param(name, marks=WITHOUT_USD) if name == "usd" else name for name in FORMATS]
HERE = [name for name in FORMATS if name != "usd" or find_spec("pxr")]
