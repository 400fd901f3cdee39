"""The pages name only files, folders, dotted names and links that exist; the drawing shows the import contracts.

The changelog may speak of the past.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest
from defusedxml import ElementTree

from docs.drawing import as_mermaid, as_svg, read_layers
from tests.test_layers import PACKAGES

ROOT = Path(__file__).resolve().parent.parent
ARCHITECTURE = ROOT / "docs" / "architecture.md"
PAGES = sorted(
    [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        ROOT / "deploy" / "README.md",
        *(page for folder in ("docs", "catalogs", "facade_core") for page in (ROOT / folder).rglob("*.md")),
    ]
)
FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"`([^`\n]+)`")
# "tasks/units/", "readers/files.py", "osm.py"; of the house, or below the page's own folder
PATH = re.compile(
    rf"(?<![\w./-])((?:{'|'.join((*PACKAGES, 'benchmarks', 'tests', 'deploy', 'docs'))})/[\w./-]*|[\w./-]*\w\.py)(?![\w*{{-])"
)
NAME = re.compile(r"(?<![\w./-])((?:facade_core|tasks|flows|catalogs|benchmarks)(?:[.:][A-Za-z_]\w*)+)(?!\w*[/-])")
LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)]*)?\)")


def code_of(text: str) -> list[str]:
    """What a page has in backticks, blocks of commands and drawings aside."""
    return CODE.findall(FENCE.sub("", text))


def missing(text: str, page: Path) -> list[str]:
    """The paths and dotted names of a page's code that are not there."""
    found = []
    for code in code_of(text):
        found += [path for path in PATH.findall(code) if not is_path(path, page)]
        found += [name for name in NAME.findall(code) if not name.endswith(".py") and not is_name(name)]
    return found


def is_path(path: str, page: Path) -> bool:
    """Whether a path is there as seen from the root or from the page; a bare name anywhere below a package's page."""
    if any((folder / path).exists() for folder in (ROOT, page.parent)):
        return True
    return "/" not in path and page.parent != ROOT and any(page.parent.rglob(path))


def is_name(dotted: str) -> bool:
    """Whether a module is there and, of the first part that is none, a name in it."""
    parts = re.split("[.:]", dotted)
    for depth in range(len(parts), 0, -1):
        place = ROOT.joinpath(*parts[:depth])
        for module in (place.with_suffix(".py"), place / "__init__.py"):
            if module.is_file():
                return depth == len(parts) or parts[depth] in names_in(module)
    return False


@cache
def names_in(module: Path) -> frozenset[str]:
    """The names that a module defines or passes on."""
    names: set[str] = set()
    for node in ast.parse(module.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names.update(alias.asname or alias.name for alias in node.names)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names.update(name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name))
    return frozenset(names)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_what_a_page_names_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert missing(text, page) == []
    local = [link for link in LINK.findall(FENCE.sub("", text)) if "://" not in link and not link.startswith("mailto:")]
    assert [link for link in local if not (page.parent / link).exists()] == []


def test_what_is_gone_is_found() -> None:
    names = ("tasks/due.py", "flows/block.py", "tasks.stages.order.STAGES_IN_ORDER", "tasks.stages.order.ORDER")
    text = ", ".join(f"`{name}`" for name in (*names, "nowhere.py", "tasks/old/"))
    assert missing(text, ARCHITECTURE) == ["tasks/due.py", "tasks.stages.order.ORDER", "nowhere.py", "tasks/old/"]
    assert missing("`flows.block:city_block`, `catalogs.open(out)`, `catalogs.readers`", ARCHITECTURE) == []


def test_the_drawing_shows_the_contracts() -> None:
    layers = read_layers()
    assert f"```mermaid\n{as_mermaid(layers)}```" in ARCHITECTURE.read_text(encoding="utf-8")
    texts = " · ".join(text.text or "" for text in ElementTree.fromstring(as_svg(layers)).iter("text")).split(" · ")
    assert {name for rows in layers.values() for row in rows for name in row} <= set(texts)


def test_every_package_has_its_line() -> None:
    rows = re.findall(r"^\| `([^`]+)/` \|", ARCHITECTURE.read_text(encoding="utf-8"), re.MULTILINE)
    packages = {
        path.parent.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).glob("*/__init__.py")
    }
    assert packages | {"flows"} == set(rows)


def commands_of_figures() -> list[str]:
    """The commands of docs/figures.md."""
    page = (ROOT / "docs" / "figures.md").read_text(encoding="utf-8")
    return [command for line in re.findall(r"^Measured: .*$", page, re.MULTILINE) for command in CODE.findall(line)]


def test_commands_of_figures_are_there_with_their_options() -> None:
    commands = [c for c in commands_of_figures() if c.startswith(("streetloom bench ", "python -m benchmarks."))]
    assert len(commands) > 40
    for command in commands:
        name, *options = command.removeprefix("streetloom bench ").removeprefix("python -m benchmarks.").split()
        place = ROOT / "benchmarks" / Path(*name.split("."))
        files = [file for file in (place.with_suffix(".py"), *place.glob("*.py")) if file.is_file()]
        assert files, command
        source = "".join(file.read_text(encoding="utf-8") for file in files)
        assert [o for o in options if o.startswith("--") and f'"{o.strip("[]")}"' not in source] == [], command


def test_every_file_of_faults_is_in_their_table() -> None:
    page = (ROOT / "docs" / "faults.md").read_text()
    tests = {path.relative_to(ROOT).as_posix() for path in (ROOT / "tests" / "faults").glob("test_*.py")}
    assert tests <= set(CODE.findall(page))
