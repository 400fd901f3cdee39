"""The pages of docs/reference are what the command writes from the declarations."""

from __future__ import annotations

from pathlib import Path

import catalogs.reference
from catalogs.block.declared_keys import declared_keys
from catalogs.block.keys import BlockFileSettings
from tasks.reference import PAGES

COMMITTED = Path(catalogs.reference.__file__).parents[1] / "docs" / "reference"


def test_committed_pages_are_what_the_command_writes(tmp_path: Path) -> None:
    catalogs.reference.write_pages(tmp_path, PAGES)
    for path in tmp_path.iterdir():
        assert (COMMITTED / path.name).read_text(encoding="utf-8") == path.read_text(encoding="utf-8"), (
            "run `python -m tasks.reference`"
        )


def test_every_field_of_a_block_file_is_declared() -> None:
    """A field without `Key` would be in no page, and its path would not be resolved."""
    keys = declared_keys(BlockFileSettings)
    sections = {"": set(BlockFileSettings.model_fields)}
    assert {name for name in keys if "." not in name} == sections[""]
    assert len(keys) > 60
    assert all(one.key.meaning.endswith(".") for one in keys.values())
    settings = [one for one in keys.values() if one.key.effect is not None]
    assert not [one.name for one in settings if one.key.path is not None or one.is_section]
