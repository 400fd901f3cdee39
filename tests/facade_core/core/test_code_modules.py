"""Syntax of modules is kept between processes, by content."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from facade_core.core.code_modules import PACKAGES_FOLDER

COUNT = """
import ast
parsed, parse = [], ast.parse
ast.parse = lambda source: parsed.append(source) or parse(source)
from facade_core.core.code_modules import PACKAGES_FOLDER, load_module
print(load_module("facade_core.core.labels", PACKAGES_FOLDER).digest, len(parsed))
"""


@pytest.mark.parametrize("damage", [None, "", "[1]", '{"a": 1}'])
def test_a_module_is_parsed_by_the_first_process_alone(
    damage: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(PACKAGES_FOLDER))

    def count() -> list[str]:
        return subprocess.run([sys.executable, "-c", COUNT], capture_output=True, text=True, check=True).stdout.split()

    first = count()
    assert first[1] == "1"
    if damage is not None:
        (file,) = (tmp_path / "streetloom").iterdir()
        file.write_text(damage)
        assert count() == first
    assert count() == [first[0], "0"]
