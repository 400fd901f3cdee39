"""Names that stores and published files depend on: a change needs a new store format, or an alias."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, get_args, get_type_hints

from facade_core.atlas.arrays import ARRAYS
from facade_core.atlas.journal import journal_path
from facade_core.atlas.stored_files import FOLDERS
from facade_core.atlas.table_schema import TABLES
from tasks.engine import seeds
from tasks.stages.journals import Journals
from tasks.stages.order import CODE_STAGES, STAGE_NAMES
from tasks.stages.poses.record import BundledPoseRecord

FILE = Path(__file__).parent / "frozen_names.json"


def names() -> dict[str, Any]:
    """The names as the code has them."""
    return {
        "arrays": [array.path for array in ARRAYS],
        "code_stages": list(CODE_STAGES),
        "columns_of_tables": {name: [column.name for column in table.columns] for name, table in TABLES.items()},
        "folders_of_files": list(FOLDERS),
        "journals": [journal_path(stage) for stage in STAGE_NAMES],
        "records_of_bundled_panoramas": sorted(get_type_hints(BundledPoseRecord)),
        "records": {stage: sorted(_record_keys(stage)) for stage in STAGE_NAMES},
        "seeds": [seeds.EXEMPLAR_SEED, seeds.FACADE_SEED, seeds.BUILDING_SEED],
        "stages": list(STAGE_NAMES),
    }


def _record_keys(stage: str) -> set[str]:
    (member,) = get_args(get_type_hints(Journals)[stage])
    record = next(one for one in get_args(member) if one is not type(None))
    return set(get_type_hints(record))


def test_frozen_names_are_unchanged() -> None:
    assert names() == json.loads(FILE.read_text(encoding="utf-8"))
