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


def test_a_byte_order_mark_and_ends_of_lines_of_windows_do_no_harm(tmp_path: Path) -> None:
    (tmp_path / "b.yaml").write_text("name: b\n")
    line = b'{"id": "a", "what": "height", "value": 9.0}\r\n'
    (tmp_path / "b.corrections.jsonl").write_bytes(b"\xef\xbb\xbf" + line)
    assert read_corrections(tmp_path / "b.yaml").value_correction("a", "height") == 9.0
