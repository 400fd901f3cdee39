"""The file of corrections: what is written is what is read."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from catalogs.block.corrections import Correction, append_corrections_to_file, read_corrections
from facade_core.core.errors import InputError


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


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("[" * 200_000, "it is nested too deeply"),
        ('{"id": "a", "what": "height", "value": ' + "9" * 5000 + "}", "a number has thousands of digits"),
        ("[1]", "it is no object in braces"),
        ('{"what": "height", "value": 9}', "it lacks id"),
        (
            '{"id": "a", "what": "height", "value": 9, "colour": 1}',
            "it has the unknown key 'colour'; there is id, what",
        ),
        ('{"id": "a", "what": "height", "value": 9, "place": 3}', "3 is no place; give longitude and latitude"),
        ('{"id": "a", "what": "height", "value": 9, "place": [24.9]}', "[24.9] is no place"),
        (
            '{"id": "a", "what": "height", "value": 9, "width": "wide"}',
            "width 'wide' is no width of a wall; give metres",
        ),
        ('{"id": "a", "what": "height", "value": 9, "width": 0}', "width 0 is no width of a wall"),
        ('{"id": "a", "what": "height", "value": 9', "(expecting ',' delimiter at column 41)"),
    ],
)
def test_a_line_that_is_no_correction_is_named_in_plain_words(tmp_path: Path, line: str, why: str) -> None:
    (tmp_path / "b.yaml").write_text("name: b\n")
    (tmp_path / "b.corrections.jsonl").write_text(f'{{"id": "a", "what": "height", "value": 9}}\n{line}\n')
    with pytest.raises(InputError, match=r"b\.corrections\.jsonl: line 2 is no correction ") as raised:
        read_corrections(tmp_path / "b.yaml")
    assert why in str(raised.value)
    assert str(raised.value).endswith("; mend or remove it")


def test_a_hundred_thousand_lines_are_read_in_seconds(tmp_path: Path) -> None:
    lines = (f'{{"id": "w{i}", "what": "height", "value": 9.5, "place": [24.9, 60.2]}}' for i in range(100_000))
    (tmp_path / "b.yaml").write_text("name: b\n")
    (tmp_path / "b.corrections.jsonl").write_text("\n".join(lines))
    begun = time.process_time()
    assert len(read_corrections(tmp_path / "b.yaml").by_target) == 100_000
    assert time.process_time() - begun < 15.0  # 2 seconds on an idle machine


def test_a_linked_file_stays_linked_and_keeps_its_mode(tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    shared, link = tmp_path / "shared" / "all.jsonl", tmp_path / "b.corrections.jsonl"
    shared.write_text('{"id": "a", "what": "height", "value": 9.0}\n')
    shared.chmod(0o640)
    link.symlink_to(shared)
    append_corrections_to_file(tmp_path / "b.yaml", [Correction("b", "height", 8.0)])
    assert link.readlink() == shared
    assert len(shared.read_text().splitlines()) == 2
    assert shared.stat().st_mode & 0o777 == 0o640
    assert read_corrections(tmp_path / "b.yaml").value_correction("b", "height") == 8.0
    assert [path.name for path in shared.parent.iterdir()] == ["all.jsonl"]
