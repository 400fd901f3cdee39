"""Imports run one way only: flows -> tasks -> {facade_core, catalogs}; catalogs -> the values of facade_core."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HOUSE = ("facade_core", "tasks", "flows", "catalogs", "benchmarks", "tests")

# What each layer may import of the house, and what it must not import of the world.
MAY = {
    "facade_core": ("facade_core",),
    "catalogs": ("catalogs", "facade_core.types", "facade_core.errors", "facade_core.labels"),
    "tasks": ("tasks", "facade_core", "catalogs"),
    "flows": ("flows", "tasks", "facade_core", "catalogs", "benchmarks"),
}
MUST_NOT = {
    "facade_core": ("prefect", "dask", "distributed"),
    "catalogs": ("prefect", "dask", "distributed"),
    "tasks": (),
    "flows": ("numpy", "zarr", "xarray"),
}


def imports(path: Path) -> list[str]:
    """Every module a file imports, at any depth, names of `from a import b` as a.b."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import; write the whole name"
            found += [f"{node.module}.{alias.name}" for alias in node.names]
    return found


def wrong_arrows(layer: str, modules: list[str]) -> list[str]:
    def within(module: str, roots: tuple[str, ...]) -> bool:
        return any(module == root or module.startswith(root + ".") for root in roots)

    return [m for m in modules if within(m, MUST_NOT[layer]) or (within(m, HOUSE) and not within(m, MAY[layer]))]


@pytest.mark.parametrize("layer", MAY)
def test_no_arrow_against_the_layers(layer: str) -> None:
    files = sorted((ROOT / layer).rglob("*.py"))
    assert files
    wrong = {str(f.relative_to(ROOT)): bad for f in files if (bad := wrong_arrows(layer, imports(f)))}
    assert wrong == {}


def test_an_arrow_the_other_way_is_found() -> None:
    assert wrong_arrows("facade_core", ["tasks.run.Run", "numpy", "dask.array"]) == ["tasks.run.Run", "dask.array"]
    assert wrong_arrows("catalogs", ["facade_core.types.Element", "facade_core.parse.parse"]) == [
        "facade_core.parse.parse"
    ]


def test_the_algorithms_import_each_other_in_no_circle() -> None:
    files = {".".join(f.relative_to(ROOT).with_suffix("").parts): f for f in (ROOT / "facade_core").rglob("*.py")}
    modules = {name.removesuffix(".__init__"): path for name, path in files.items()}

    def module_of(name: str) -> str:
        return name if name in modules else name.rpartition(".")[0]

    arrows = {name: {module_of(m) for m in imports(path)} & modules.keys() - {name} for name, path in modules.items()}
    assert arrows["facade_core.layout.scores"] >= {"facade_core.layout.model", "facade_core.layout.statistics"}
    TopologicalSorter(arrows).prepare()  # names the circle where there is one


def test_units_know_no_prefect() -> None:
    """What runs on a worker starts without Prefect, which takes seconds to import."""
    for path in (ROOT / "tasks" / "units").glob("*.py"):
        assert not [m for m in imports(path) if m.split(".")[0] == "prefect"]


def test_no_utils() -> None:
    assert not [p for layer in MAY for p in (ROOT / layer).rglob("util*.py")]
