"""What numba compiled is kept for the code that it was compiled of, and for no other."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

from facade_core.kernels import PACKAGE, folder_for

CALLED = "from numba import njit\n\n@njit(cache=True)\ndef called():\n    return {}\n"
CALLER = (
    "from pathlib import Path\nimport numba\nfrom facade_core.kernels import folder_for\n"
    "numba.config.CACHE_DIR = str(folder_for(Path(__file__).parent, (Path(__file__).parent.parent / 'cache',)))\n"
    "from code_.called import called\nfrom numba import njit\n\n"
    "@njit(cache=True)\ndef caller():\n    return called() + 1\n\nprint(caller(), sum(caller.stats.cache_hits.values()))\n"
)


def test_a_caller_is_compiled_anew_where_what_it_calls_changed(tmp_path: Path) -> None:
    code = tmp_path / "code_"
    code.mkdir()
    (code / "caller.py").write_text(CALLER)
    said = []
    for number in (1, 1, 2):
        (code / "called.py").write_text(CALLED.format(number))
        path = os.pathsep.join((str(tmp_path), str(PACKAGE.parent)))
        environment = os.environ | {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run(
            [sys.executable, "-m", "code_.caller"], env=environment, capture_output=True, text=True, check=True
        )
        said.append(done.stdout.split())
    assert said == [["2", "0"], ["2", "1"], ["3", "0"]]
    assert len(list((tmp_path / "cache").iterdir())) == 1  # what was of other code is gone


def test_a_folder_that_cannot_be_written_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    folder = folder_for(tmp_path, (tmp_path / "file", tmp_path / "other"))
    assert folder is not None
    assert folder.parent == tmp_path / "other"
    assert folder_for(tmp_path, (tmp_path / "file",)) is None


def test_all_kernels_are_cached_there() -> None:
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert "numba" not in names or path.name == "kernels.py", path
