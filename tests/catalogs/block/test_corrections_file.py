"""The file of corrections: what is written is what is read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from catalogs.block.corrections import Correction, append_corrections_to_file, read_corrections


@pytest.mark.parametrize("why", ["a\u2028b", "a\u2029b", "a\x85b", "a\nb\r\nc", "ä, ö", ""])
def test_a_reason_of_any_letters_is_one_line(tmp_path: Path, why: str) -> None:
    one = Correction("w1-0", "facade", False, why=why)
    for count in range(2):
        append_corrections_to_file(tmp_path / "block.yaml", [replace(one, who=f"anna {count}")])
    assert read_corrections(tmp_path / "block.yaml").by_target["w1-0"]["facade"].why == why
