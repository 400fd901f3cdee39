"""Digests of the code of each stage: the modules that its worker imports, their data files, and the versions of libraries.

A change makes pending what it reaches, and nothing else. Of a module its syntax counts, not its comments, docstrings, layout
or imports for type checkers. A name that a package only passes on is followed to its definition.
"""

from __future__ import annotations

import ast
import gc
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from importlib.util import resolve_name
from pathlib import Path
from threading import Lock

from facade_core.imagery.detect.models import models_digest
from tasks.engine.data_files import DATA_FILES

# Streets ask side by side, and Python before 3.11.5 may fail where the collector lets another thread parse meanwhile.
_PARSING = Lock()

VERSION = "0.1.0"
ROOT = Path(__file__).resolve().parent.parent.parent
CODE_PACKAGES = ("facade_core", "catalogs", "tasks")

# The translator that only runs with `translator: neural` take.
NEURAL_TRANSLATOR = "facade_core.street.translator.neural_translator"
# What finds models in packages that may be installed or not: both the presence and the content of these count.
DETECTION_MODELS = "facade_core.imagery.detect.models"
# What decides when and where units run, keeps what they made, or says what went wrong. A run's settings are in the keys.
EXCLUDED_MODULES = frozenset(
    {
        "facade_core.core.errors",
        "facade_core.atlas.journal",
        "facade_core.atlas.store",
        "facade_core.core.zarr_types",
        "tasks.engine.store.commits",
        "tasks.engine.outcome",
        "tasks.engine.progress",
        "tasks.engine.store.disk_space",
        "tasks.engine.run",
        "tasks.engine.stage_code",
        "tasks.stages.order",
        "tasks.engine.store.integrity",
    }
)
# Likewise of libraries; and what encodes pictures of exports alone, which no unit does, or rewrites the header of a model whose
# content counts (an environment for tests has it, one for users only where that model is).
EXCLUDED_LIBRARIES = frozenset(
    {
        "alktx2",
        "dask",
        "distributed",
        "icechunk",
        "libusb_package",
        "onnx",
        "prefect",
        "psutil",
        "threadpoolctl",
        "xarray",
        "zarr",
    }
)
# Under which name a library is installed, where that is not the one it is imported by.
DISTRIBUTION_NAMES = {
    "PIL": "pillow",
    "cv2": "opencv-python-headless",
    "maxflow": "PyMaxflow",
    "open3d": "open3d-cpu",
    "skimage": "scikit-image",
    "sklearn": "scikit-learn",
    "yaml": "pyyaml",
}


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


@cache
def stage_code_digest(stage: str, *, neural: bool = True, root: Path = ROOT) -> str:
    """Compute the digest of the code of a stage.

    Parameters
    ----------
    stage : name of the stage.
    neural : whether it takes the network that translates panoramas.
    root : folder of the packages.
    """
    found = collect_modules(
        [worker_module(stage, root)], EXCLUDED_MODULES if neural else EXCLUDED_MODULES | {NEURAL_TRANSLATOR}, root
    )
    digest = blake2b(digest_size=8)
    for name in sorted(found):
        digest.update(f"{name} {found[name].digest}\n".encode())
    for file in sorted({file for name in found for file in DATA_FILES.get(name, ())}):
        digest.update(f"{file} {_content_digest(root / file)}\n".encode())
    digest.update(f"python {sys.version_info.major}.{sys.version_info.minor}\n".encode())
    outside = {name.partition(".")[0] for module in found.values() for name, _ in module.imports}
    for library in sorted(outside - sys.stdlib_module_names - EXCLUDED_LIBRARIES - set(CODE_PACKAGES)):
        digest.update(f"{library} {_library_version(library)}\n".encode())
    if DETECTION_MODELS in found:
        digest.update(f"detect {models_digest()}\n".encode())
    return digest.hexdigest()


def worker_module(stage: str, root: Path = ROOT) -> str:
    """Return the dotted name of the module that processes a stage's units, or of a module of `tasks`."""
    places = (f"tasks.stages.{stage}.worker", f"tasks.stages.{stage}.task", f"tasks.{stage}.task", f"tasks.{stage}")
    return next(name for name in places if _module_path(name, root) is not None)


@cache
def code_version(stages: tuple[str, ...], root: Path = ROOT) -> str:
    """Return the version and a digest of the code of some stages: workers of one cluster must agree on it."""
    return join_code_versions({stage: stage_code_digest(stage, root=root) for stage in stages})


def join_code_versions(codes: Mapping[str, str]) -> str:
    """Return the version of the package and a digest of the codes of some stages."""
    text = "\n".join(f"{stage} {code}" for stage, code in sorted(codes.items()))
    return f"{VERSION}+{blake2b(text.encode(), digest_size=6).hexdigest()}"


def collect_modules(
    starts: Iterable[str], apart: Iterable[str], root: Path, house: Collection[str] = CODE_PACKAGES
) -> dict[str, CodeModule]:
    """Collect the modules of this project that some modules import, at any depth and in functions too.

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
        module = _load_module(name, root)
        if module is None:
            continue
        found[name] = module
        for imported, member in module.imports:
            waiting += _resolve_import(imported, member, root, house)
        # what runs before a module is the code of the packages around it
        waiting += [
            package
            for package in _parent_packages(name)
            if (around := _load_module(package, root)) is not None and not around.passes_on
        ]
    return found


def _resolve_import(name: str, member: str, root: Path, house: Collection[str]) -> list[str]:
    """Return the modules that define an imported name."""
    if name.partition(".")[0] not in house:
        return []
    below = f"{name}.{member}" if member else name
    module = _load_module(name, root)
    if member and module is not None and module.passes_on:
        bound = [source for source in module.imports if source[1] == member]
        if bound:
            return [one for source in bound for one in _resolve_import(*source, root, house)]
    if member and _module_path(below, root) is not None:
        return [below]
    return [name]


def _parent_packages(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:depth]) for depth in range(1, len(parts))]


@cache
def _module_path(name: str, root: Path) -> Path | None:
    place = root.joinpath(*name.split("."))
    return next((path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()), None)


@cache
def _load_module(name: str, root: Path) -> CodeModule | None:
    """Load a module below `root`, None if there is none."""
    path = _module_path(name, root)
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
def _content_digest(path: Path) -> str:
    return blake2b(path.read_bytes(), digest_size=8).hexdigest()


@cache
def _library_version(library: str) -> str:
    try:
        return version(DISTRIBUTION_NAMES.get(library, library))
    except PackageNotFoundError:
        return "none"
