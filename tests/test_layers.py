"""Rules of the packages that import contracts (pyproject.toml, `lint-imports`) cannot state, and that the contracts hold."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

from facade_core.core.code_modules import load_module

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("facade_core", "catalogs", "tasks", "flows", "training")
MAX_FILES = 30  # of a folder
LEVELS = ("debug", "info", "warning", "error", "exception", "critical")


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(module: str) -> frozenset[str]:
    """Return every module that a module imports, at any depth, names of `from a import b` as a.b."""
    found = load_module(module, ROOT)
    assert found is not None
    return frozenset(f"{name}.{member}" if member else name for name, member in found.imports)


@cache
def modules(package: str) -> dict[str, Path]:
    """Return the files of a package by the names of their modules."""
    files = {".".join(f.relative_to(ROOT).with_suffix("").parts): f for f in sorted((ROOT / package).rglob("*.py"))}
    return {name.removesuffix(".__init__"): path for name, path in files.items()}


def reached(start: Iterable[str]) -> set[str]:
    """Return the modules that importing some of them runs, imports inside functions included."""
    known = {name for package in (*PACKAGES, "benchmarks") for name in modules(package)}
    seen: set[str] = set()
    waiting = list(start)
    while waiting:
        module = waiting.pop()
        if module in known and module not in seen:
            seen.add(module)
            imported = imports(module)
            waiting += [*imported, *(name.rpartition(".")[0] for name in imported), module.rpartition(".")[0]]
    return seen


def within(module: str, roots: Iterable[str]) -> bool:
    return any(module == root or module.startswith(root + ".") for root in roots)


def test_import_contracts_hold() -> None:
    command = [Path(sys.executable).with_name("lint-imports"), "--no-cache"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout[-3000:]
    assert "9 kept, 0 broken" in result.stdout


def test_workers_start_without_prefect() -> None:
    """A worker reaches neither Prefect, which takes seconds to import, nor modules of the coordinator."""
    workers = [name for name in modules("tasks") if name.startswith("tasks.stages.") and name.endswith(".worker")]
    assert len(workers) == 12
    seen = reached(workers)
    assert {"facade_core.street.propagation.propagate", "catalogs.readers.pictures.decoding"} <= seen
    engine = {name for name in seen if within(name, ["tasks.engine"])}
    known = ("atlas", "context", "inputs", "outcome", "processing", "progress", "run", "seeds", "unit")
    assert engine <= {"tasks.engine", *(f"tasks.engine.{name}" for name in known)}
    stages = {name for name in seen if within(name, ["tasks.stages"])}
    assert not {name for name in stages if name.endswith((".stage", ".task", ".keys", ".forecast", ".order"))}
    libraries = {name.split(".")[0] for module in seen for name in imports(module)}
    assert "numpy" in libraries
    assert "prefect" not in libraries


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_is_crowded(package: str) -> None:
    files = Counter(path.parent.relative_to(ROOT).as_posix() for path in modules(package).values())
    assert {folder: count for folder, count in files.items() if count > MAX_FILES} == {}


def test_only_the_command_imports_training() -> None:
    importers = {name for name in modules("flows") if any(within(one, ["training"]) for one in imports(name))}
    assert importers == {"flows.cli.training"}


def _dotted(node: ast.AST) -> str:
    return ast.unparse(node) if isinstance(node, ast.Name | ast.Attribute) else ""


@pytest.mark.parametrize("package", PACKAGES)
def test_modules_log_by_their_name_and_print_nothing(package: str) -> None:
    for name, path in modules(package).items():
        tree = parsed(path)
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        called = {_dotted(call.func) for call in calls}
        if not within(name, ["flows.cli"]):
            assert called.isdisjoint({"print", "click.echo", "sys.stdout.write", "sys.stderr.write"}), name
        assert called.isdisjoint({f"logging.{level}" for level in LEVELS}), f"{name} logs without a logger"
        loggers = [call for call in calls if ast.unparse(call) == "logging.getLogger(__name__)"]
        if loggers or called & {f"log.{level}" for level in LEVELS}:
            assert len(loggers) == 1, name
            assert "log = logging.getLogger(__name__)" in [ast.unparse(node) for node in tree.body], name


def test_no_utils() -> None:
    assert not [path for package in PACKAGES for path in (ROOT / package).rglob("util*.py")]


def test_no_archive_is_unpacked_to_paths() -> None:
    """Members of archives are read into memory under checked sizes, so that none names where it is written."""
    forbidden = {"extract", "extractall", "unpack_archive", "tarfile"}
    for package in PACKAGES:
        for name, path in modules(package).items():
            tree = parsed(path)
            called = {
                node.func.attr
                for node in ast.walk(tree)
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
            }
            assert not forbidden & (called | {one.split(".")[0] for one in imports(name)}), name
