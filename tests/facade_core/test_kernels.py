"""What numba compiled is kept for the code that it was compiled of, and for no other."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

from facade_core.core.numba_cache import PACKAGE_FOLDER, code_digest, first_writable_folder

CALLED = "from code_.core.numba_cache import njit\n\n@njit(cache=True)\ndef called():\n    return {}\n"
CALLER = (
    "from code_.called import called\nfrom code_.core.numba_cache import njit\n\n"
    "@njit(cache=True)\ndef caller():\n    return called() + 1\n\n"
    "print(caller(), sum(caller.stats.cache_hits.values()))\n"
)


def test_a_caller_is_compiled_anew_where_what_it_calls_changed_and_only_there(tmp_path: Path) -> None:
    code = tmp_path / "code_"
    code.mkdir()
    (code / "core").mkdir()
    shutil.copy(PACKAGE_FOLDER / "core" / "numba_cache.py", code / "core")
    (code / "caller.py").write_text(CALLER)
    said = []
    for number, other in ((1, 1), (1, 2), (2, 2)):
        (code / "called.py").write_text(CALLED.format(number))
        (code / "other.py").write_text(f"OTHER = {other}\n")
        environment = os.environ | {
            "PYTHONPATH": str(tmp_path),
            "PYTHONDONTWRITEBYTECODE": "1",
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        }
        run = [sys.executable, "-c", "import code_.caller"]
        done = subprocess.run(run, env=environment, capture_output=True, text=True, check=True)
        said.append(done.stdout.split())
    assert said == [["2", "0"], ["2", "1"], ["3", "0"]]
    (place,) = (tmp_path / "cache").iterdir()
    assert len(list((place / "code_.caller").iterdir())) == 1  # what was of other code is gone


def test_a_digest_is_of_what_a_module_imports_at_any_depth() -> None:
    assert code_digest("facade_core.core.labels") != code_digest("facade_core.core.types")
    assert code_digest("facade_core.core.labels") == code_digest("facade_core.core.labels")


def test_a_folder_that_cannot_be_written_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    assert first_writable_folder((tmp_path / "file" / "a", tmp_path / "other")) == tmp_path / "other"
    assert first_writable_folder((tmp_path / "file" / "a",)) is None


def test_all_kernels_are_cached_there() -> None:
    for path in PACKAGE_FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [node.module] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            assert "numba" not in names or path.name == "numba_cache.py", path


# What takes numba longer to compile than a kernel that calls it; loops do the same.
SLOW_TO_COMPILE = {
    "any",
    "argsort",
    "bincount",
    "concatenate",
    "diff",
    "flatnonzero",
    "median",
    "partition",
    "searchsorted",
}
SLOW_TO_COMPILE |= {"sort", "std", "sum", "take", "unique"}


def test_kernels_call_nothing_that_takes_long_to_compile() -> None:
    kernels = 0
    for path in sorted(PACKAGE_FOLDER.rglob("*.py")):
        for function in ast.walk(ast.parse(path.read_text())):
            if not isinstance(function, ast.FunctionDef) or "njit" not in map(_called, function.decorator_list):
                continue
            kernels += 1
            for node in ast.walk(function):
                assert _called(node) not in SLOW_TO_COMPILE, (path, node.lineno)
                if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
                    slices = [part for part in ast.walk(node.slice) if isinstance(part, ast.Slice)]
                    assert all(part.lower is None and part.upper is None for part in slices), (path, node.lineno)
    assert kernels > 100


def _called(node: ast.AST) -> str | None:
    """The name of what is called."""
    if not isinstance(node, ast.Call):
        return None
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", None)
