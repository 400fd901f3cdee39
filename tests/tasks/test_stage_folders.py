"""One folder per stage: the engine and all readers know no stage by name."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tasks.engine.data_files import DATA_FILES, NOT_LOADED_BY_STAGES
from tasks.engine.stage_code import EXCLUDED_MODULES, ROOT, worker_module
from tasks.stages.order import CODE_STAGES, STAGE_NAMES, STAGES_IN_ORDER

PACKAGES = ("facade_core", "catalogs", "tasks", "flows")
NAMES = {*STAGE_NAMES, *CODE_STAGES}


def comparisons(path: Path) -> Iterator[tuple[int, str]]:
    """Lines in which a stage is compared with a stage's name, and that name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            if any(_is_stage(side) for side in sides):
                found = {one.value for side in sides for one in ast.walk(side) if isinstance(one, ast.Constant)}
                yield from ((node.lineno, str(name)) for name in sorted(found & NAMES, key=str))
        elif isinstance(node, ast.Match) and _is_stage(node.subject):
            cases = (case.pattern for case in node.cases)
            found = {one.value for case in cases for one in ast.walk(case) if isinstance(one, ast.Constant)}
            yield from ((node.lineno, str(name)) for name in sorted(found & NAMES, key=str))


def _is_stage(node: ast.expr) -> bool:
    return (isinstance(node, ast.Attribute) and node.attr == "stage") or (
        isinstance(node, ast.Name) and node.id == "stage"
    )


def test_no_module_outside_a_stage_compares_its_name() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for line, name in comparisons(path)
        if not path.is_relative_to(ROOT / "tasks" / "stages" / name)
    ]
    assert found == []


def test_a_comparison_is_found(tmp_path: Path) -> None:
    path = tmp_path / "a.py"
    path.write_text('if unit.stage == "facades" or stage in ("walls", "other"):\n    pass\n')
    assert list(comparisons(path)) == [(1, "facades"), (1, "walls")]


def test_the_engine_names_no_stage() -> None:
    found = []
    for path in sorted((ROOT / "tasks" / "engine").rglob("*.py")):
        constants = {node.value for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant)}
        found += [(path.relative_to(ROOT).as_posix(), name) for name in STAGE_NAMES if name in constants]
    # kinds of input in keys, and a key of the store's attributes
    allowed = {("tasks/engine/pending_reasons.py", name) for name in ("streets", "walls")}
    allowed |= {("tasks/engine/store/carry_over.py", "pages")}
    assert set(found) <= allowed


@pytest.mark.parametrize("stage", CODE_STAGES)
def test_a_stage_has_a_folder(stage: str) -> None:
    *parts, module = worker_module(stage).split(".")
    folder = ROOT.joinpath(*parts)
    assert folder in (ROOT / "tasks" / "stages" / stage, ROOT / "tasks" / stage)
    body = ast.parse((folder / "__init__.py").read_text()).body
    assert [type(node) for node in body] == [ast.Expr], "a docstring only"
    if stage in STAGE_NAMES:
        assert module == "worker"
        assert {"stage.py", "worker.py", "record.py"} <= {path.name for path in folder.iterdir()}


def test_every_data_file_is_declared() -> None:
    """Content of data files is in the code digests of stages: one that is not declared could change unseen."""
    undeclared = []
    declared = {file for files in DATA_FILES.values() for file in files}
    for package in ("facade_core", "catalogs", "tasks"):
        for path in sorted((ROOT / package).rglob("*")):
            file = path.relative_to(ROOT).as_posix()
            if path.is_dir() or "__pycache__" in path.parts:
                continue
            if path.suffix not in (".py", ".pyi", ".pyc", ".md", ".typed") and file not in declared:
                undeclared += [file] if not file.startswith(NOT_LOADED_BY_STAGES) else []
    assert undeclared == []
    assert all((ROOT / file).is_file() for file in declared)
    for module in (*DATA_FILES, *EXCLUDED_MODULES):
        place = ROOT.joinpath(*module.split("."))
        assert place.with_suffix(".py").is_file(), module


def test_parts_name_their_stage() -> None:
    for stage in STAGES_IN_ORDER:
        assert (stage.compute is None) == (stage.write is None)
        assert (stage.process is None) == (stage.compute is not None)
