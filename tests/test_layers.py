"""Imports run one way only: flows -> tasks -> {facade_core, catalogs}; catalogs -> the values of facade_core. Within tasks and
catalogs they run from the rooms above to those below; nowhere in a circle. Who has something to say logs it."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
HOUSE = ("facade_core", "tasks", "flows", "catalogs", "benchmarks", "tests")

# What each layer may import of the house, and what it must not import of the world.
MAY = {
    "facade_core": ("facade_core",),
    "catalogs": ("catalogs", "facade_core.core.types", "facade_core.core.errors", "facade_core.core.labels"),
    "tasks": ("tasks", "facade_core", "catalogs"),
    "flows": ("flows", "tasks", "facade_core", "catalogs", "benchmarks"),
}
MUST_NOT = {
    "facade_core": ("prefect", "dask", "distributed"),
    "catalogs": ("prefect", "dask", "distributed"),
    "tasks": (),
    "flows": ("numpy", "zarr", "xarray"),
}
# The rooms of a layer and the modules beside them, in storeys from the ground up: each imports from lower storeys only.
STOREYS = {
    "tasks": (
        ("engine",),
        ("stages",),
        ("publish",),
        (
            "city",
            "doctor",
            "examples",
            "export",
            "fetching",
            "history",
            "matching",
            "metrics",
            "otlp",
            "training",
            "viewing",
        ),
        ("corrections",),
    ),
    "catalogs": (
        ("crs", "features", "file_digest", "printable_text", "reader_errors"),
        ("readers",),
        ("buildings", "examples", "imagery", "learning", "published"),
        ("query", "stac"),
        ("block",),
        ("city",),
    ),
}
MOST_FILES = 18  # of a room
LEVELS = ("debug", "info", "warning", "error", "exception", "critical")


def _imports(node: ast.AST, *, for_types: bool) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        assert node.level == 0, f"line {node.lineno}: relative import; write the whole name"
        yield from (f"{node.module}.{alias.name}" for alias in node.names)
    elif (
        not for_types
        and isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    ):
        for statement in node.orelse:
            yield from _imports(statement, for_types=for_types)
    else:
        for child in ast.iter_child_nodes(node):
            yield from _imports(child, for_types=for_types)


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path: Path, *, for_types: bool = True) -> frozenset[str]:
    """Every module a file imports, at any depth, names of `from a import b` as a.b; those for type checkers too, or not."""
    return frozenset(_imports(parsed(path), for_types=for_types))


@cache
def modules(layer: str) -> dict[str, Path]:
    """The files of a layer by the names of their modules."""
    files = {".".join(f.relative_to(ROOT).with_suffix("").parts): f for f in sorted((ROOT / layer).rglob("*.py"))}
    return {name.removesuffix(".__init__"): path for name, path in files.items()}


def arrows(layers: Iterable[str], *, for_types: bool = False) -> dict[str, set[str]]:
    """The modules of some layers, and which of each other they import."""
    known = {name: path for layer in layers for name, path in modules(layer).items()}

    def module_of(name: str) -> str:
        return name if name in known else name.rpartition(".")[0]

    return {
        name: {module_of(m) for m in imports(path, for_types=for_types)} & known.keys() - {name}
        for name, path in known.items()
    }


def within(module: str, roots: Iterable[str]) -> bool:
    return any(module == root or module.startswith(root + ".") for root in roots)


def wrong_arrows(layer: str, names: Iterable[str]) -> list[str]:
    return sorted(m for m in names if within(m, MUST_NOT[layer]) or (within(m, HOUSE) and not within(m, MAY[layer])))


def upward(layer: str, imported: dict[str, set[str]]) -> set[tuple[str, str]]:
    """The arrows between rooms of a layer that do not lead to a lower storey."""
    storey = {f"{layer}.{room}": number for number, rooms in enumerate(STOREYS[layer]) for room in rooms}

    def room(module: str) -> str:
        parts = module.split(".")
        return next((name for depth in (3, 2) if (name := ".".join(parts[:depth])) in storey), ".".join(parts[:2]))

    pairs = ((one, other) for one, others in imported.items() for other in others if {one, other}.isdisjoint({layer}))
    return {(a, b) for a, b in pairs if room(a) != room(b) and storey[room(a)] <= storey[room(b)]}


def reached(start: Iterable[str], imported: dict[str, set[str]]) -> set[str]:
    """The modules that importing some of them runs, their packages too, once every import within functions is done."""
    seen: set[str] = set()
    waiting = list(start)
    while waiting:
        module = waiting.pop()
        if module and module not in seen:
            seen.add(module)
            waiting += [*imported[module], module.rpartition(".")[0]]
    return seen


@pytest.mark.parametrize("layer", MAY)
def test_no_arrow_against_the_layers(layer: str) -> None:
    assert modules(layer)
    wrong = {name: bad for name, path in modules(layer).items() if (bad := wrong_arrows(layer, imports(path)))}
    assert wrong == {}


def test_an_arrow_the_other_way_is_found() -> None:
    assert wrong_arrows("facade_core", ["tasks.engine.run.Run", "numpy", "dask.array"]) == [
        "dask.array",
        "tasks.engine.run.Run",
    ]
    assert wrong_arrows("catalogs", ["facade_core.core.types.Element", "facade_core.parse.parse"]) == [
        "facade_core.parse.parse"
    ]


@pytest.mark.parametrize("layer", STOREYS)
def test_rooms_import_from_lower_storeys_only(layer: str) -> None:
    listed = sorted({room.split(".")[0] for rooms in STOREYS[layer] for room in rooms})
    assert listed == sorted({name.split(".")[1] for name in modules(layer) if name != layer})
    assert upward(layer, arrows([layer], for_types=True)) == set()


def test_an_arrow_up_is_found() -> None:
    up = ("tasks.engine.forecast", "tasks.stages.facades.stage")
    across = ("tasks.export.city", "tasks.viewing.run_view")
    published = ("tasks.stages.order", "tasks.publish.task")
    down = ("tasks.publish.task", "tasks.stages.order")
    inside = ("tasks.stages.facades.stage", "tasks.stages.bundles.stage")
    arrows_of = {one: {other} for one, other in (up, across, published, down, inside)}
    assert upward("tasks", arrows_of) == {up, across, published}


@pytest.mark.parametrize("layers", [["facade_core"], ["catalogs", "tasks", "flows"]])
def test_modules_import_each_other_in_no_circle(layers: list[str]) -> None:
    imported = arrows(layers)
    if "facade_core" in layers:
        assert imported["facade_core.facade.layout.scores"] >= {
            "facade_core.facade.layout.model",
            "facade_core.facade.layout.statistics",
        }
    TopologicalSorter(imported).prepare()  # names the circle where there is one


def test_workers_start_without_prefect() -> None:
    """What runs on a worker reaches neither Prefect, which takes seconds to import, nor the coordinator's modules."""
    everything = ("facade_core", "catalogs", "tasks", "flows", "benchmarks")
    workers = [name for name in modules("tasks") if name.startswith("tasks.stages.") and name.endswith(".worker")]
    assert len(workers) == 12
    seen = reached(workers, arrows(everything))
    assert {"facade_core.street.propagation.propagate", "catalogs.readers.pictures.decoding"} <= seen
    engine = {name for name in seen if within(name, ["tasks.engine"])}
    known = ("context", "outcome", "progress", "run", "seeds", "unit")
    assert engine <= {"tasks.engine", *(f"tasks.engine.{name}" for name in known)}
    stages = {name for name in seen if within(name, ["tasks.stages"])}
    assert not {name for name in stages if name.endswith((".stage", ".task", ".keys", ".forecast", ".order"))}
    paths = {name: path for layer in everything for name, path in modules(layer).items()}
    world = {name.split(".")[0] for module in seen for name in imports(paths[module], for_types=False)}
    assert "numpy" in world
    assert "prefect" not in world


@pytest.mark.parametrize("layer", ["tasks", "catalogs", "flows"])
def test_no_room_is_crowded(layer: str) -> None:
    files = Counter(path.parent.relative_to(ROOT).as_posix() for path in modules(layer).values())
    assert {room: count for room, count in files.items() if count > MOST_FILES} == {}


def _named(node: ast.AST) -> str:
    return ast.unparse(node) if isinstance(node, ast.Name | ast.Attribute) else ""


@pytest.mark.parametrize("layer", MAY)
def test_modules_log_by_their_name_and_print_nothing(layer: str) -> None:
    for name, path in modules(layer).items():
        tree = parsed(path)
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        called = {_named(call.func) for call in calls}
        if not within(name, ["flows.cli"]):
            assert called.isdisjoint({"print", "click.echo", "sys.stdout.write", "sys.stderr.write"}), name
        assert called.isdisjoint({f"logging.{level}" for level in LEVELS}), f"{name} logs as nobody"
        loggers = [call for call in calls if ast.unparse(call) == "logging.getLogger(__name__)"]
        if loggers or called & {f"log.{level}" for level in LEVELS}:
            assert len(loggers) == 1, name
            assert "log = logging.getLogger(__name__)" in [ast.unparse(node) for node in tree.body], name


def test_no_utils() -> None:
    assert not [p for layer in MAY for p in (ROOT / layer).rglob("util*.py")]
