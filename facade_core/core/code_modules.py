"""Imports and digests of Python code: the modules that a module imports, and what their syntax is.

Of a module its syntax counts, not its comments, docstrings, layout or imports for type checkers. A name that a package only
passes on is followed to its definition.
"""

from __future__ import annotations

import ast
import gc
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from importlib.util import resolve_name
from pathlib import Path
from threading import Lock

# Streets ask side by side, and Python before 3.11.5 may fail where the collector lets another thread parse meanwhile.
_PARSING = Lock()


@dataclass(frozen=True)
class CodeModule:
    """A module of this project.

    Attributes
    ----------
    path : its file.
    digest : digest of its syntax.
    imports : pairs of a module and a name of it, "" for the module itself.
    passes_on : whether it only imports names for others.
    """

    path: Path
    digest: str
    imports: tuple[tuple[str, str], ...]
    passes_on: bool


def collect_modules(
    starts: Iterable[str], apart: Collection[str], root: Path, house: Collection[str]
) -> dict[str, CodeModule]:
    """Collect the modules of some packages that modules import, at any depth and in functions too.

    Parameters
    ----------
    starts : names of modules; they are part of the result.
    apart : modules that are not followed.
    root : folder of the packages.
    house : packages that are followed.
    """
    found: dict[str, CodeModule] = {}
    waiting = list(starts)
    while waiting:
        name = waiting.pop()
        if name in found or name in apart:
            continue
        module = load_module(name, root)
        if module is None:
            continue
        found[name] = module
        for imported, member in module.imports:
            waiting += _resolve_import(imported, member, root, house)
        # what runs before a module is the code of the packages around it
        waiting += [
            package
            for package in _parent_packages(name)
            if (around := load_module(package, root)) is not None and not around.passes_on
        ]
    return found


def _resolve_import(name: str, member: str, root: Path, house: Collection[str]) -> list[str]:
    """Return the modules that define an imported name."""
    if name.partition(".")[0] not in house:
        return []
    below = f"{name}.{member}" if member else name
    module = load_module(name, root)
    if member and module is not None and module.passes_on:
        bound = [source for source in module.imports if source[1] == member]
        if bound:
            return [one for source in bound for one in _resolve_import(*source, root, house)]
    if member and module_path(below, root) is not None:
        return [below]
    return [name]


def _parent_packages(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:depth]) for depth in range(1, len(parts))]


@cache
def module_path(name: str, root: Path) -> Path | None:
    """Return the file of a module below `root`, None if there is none."""
    place = root.joinpath(*name.split("."))
    return next((path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()), None)


@cache
def load_module(name: str, root: Path) -> CodeModule | None:
    """Load a module below `root`, None if there is none."""
    path = module_path(name, root)
    return None if path is None else _parse_module(name, path, path.stat().st_mtime_ns)


@cache
def _parse_module(name: str, path: Path, modified: int) -> CodeModule:
    with _PARSING:
        collecting = gc.isenabled()
        gc.disable()  # a tree is many small objects, none of which can go yet
        try:
            tree = ast.parse(path.read_bytes())
            said: list[str] = []
            imports: list[ast.Import | ast.ImportFrom] = []
            _collect_syntax(tree, said, imports)
        finally:
            if collecting:
                gc.enable()
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    return CodeModule(
        path,
        blake2b("\n".join(said).encode(errors="surrogatepass"), digest_size=8).hexdigest(),
        tuple(dict.fromkeys(pair for node in imports for pair in _imported_names(node, package))),
        path.name == "__init__.py" and all(map(_only_passes_names, tree.body)),
    )


def _collect_syntax(node: ast.AST, said: list[str], imports: list[ast.Import | ast.ImportFrom]) -> None:
    """Return the text of a syntax tree for a digest, and its imports.

    Docstrings, imports for type checkers and places in the text are left out.
    """
    if isinstance(node, ast.Import | ast.ImportFrom):
        imports.append(node)
    said.append(node.__class__.__name__)
    for field in node._fields:
        value = getattr(node, field, None)
        if value is None:
            said.append("None")
        elif isinstance(value, list):
            kept = (
                [one for one in value if not (_is_text(one) or _is_for_type_checking(one))]
                if field in _BODIES
                else value
            )
            said.append(str(len(kept)))
            for one in kept:
                if isinstance(one, ast.AST):
                    _collect_syntax(one, said, imports)
                else:
                    said.append(repr(one))
        elif not isinstance(value, ast.AST):
            said.append(repr(value))
        elif field != "ctx":  # where a name stands says whether it is read
            _collect_syntax(value, said, imports)


_BODIES = frozenset({"body", "orelse", "finalbody"})


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _is_for_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _only_passes_names(node: ast.AST) -> bool:
    """Return whether a statement of a package imports or lists names, or is a docstring."""
    listed = isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["__all__"]
    return listed or isinstance(node, ast.Import | ast.ImportFrom) or _is_text(node) or _is_for_type_checking(node)


def _imported_names(node: ast.Import | ast.ImportFrom, package: str) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.Import):
        yield from ((alias.name, "") for alias in node.names)
    else:
        module = resolve_name("." * node.level + (node.module or ""), package)
        yield from ((module, alias.name) for alias in node.names)


@cache
def content_digest(path: Path) -> str:
    """Compute the digest of a file."""
    return blake2b(path.read_bytes(), digest_size=8).hexdigest()


def packages_digest(packages: Iterable[str], root: Path) -> str:
    """Compute the digest of all Python files of some packages, which takes less time than to follow imports."""
    digest = blake2b(digest_size=16)
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(f"{path.relative_to(root)} {content_digest(path)}\n".encode())
    return digest.hexdigest()
