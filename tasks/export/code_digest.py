"""Key of an export: two exports with one key have the same files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache

from facade_core.core.code_modules import packages_digest
from tasks.engine.stage_code import CODE_PACKAGES, ROOT, VERSION


def export_key(format: str, snapshot: str, buildings: Sequence[str], options: Mapping[str, object]) -> str:
    """Compute the key of an export from what it is made of, and from the code.

    Parameters
    ----------
    format : format of the export.
    snapshot : published snapshot.
    buildings : selected buildings; empty: all.
    options : options of the format, with values of JSON.
    """
    values = [format, snapshot, sorted(buildings), dict(sorted(options.items())), VERSION, _code_digest()]
    return hashlib.sha256(json.dumps(values).encode(errors="surrogatepass")).hexdigest()[:32]


@cache
def _code_digest() -> str:
    return packages_digest(CODE_PACKAGES, ROOT)
