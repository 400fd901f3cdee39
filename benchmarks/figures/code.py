"""The code that a command measures, as a digest of each room that it reaches: what has changed since is told by name."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from hashlib import blake2b
from pathlib import Path

from facade_core.core.code_modules import collect_modules, content_digest
from tasks.engine.data_files import DATA_FILES
from tasks.engine.stage_code import CODE_PACKAGES, ROOT

MEASURED = (*CODE_PACKAGES, "flows", "training", "benchmarks")
COMMANDS = ("streetloom bench ", "python -m benchmarks.")
WHOLE = "flows.__main__"
# Data files that modules of benchmarks load, as DATA_FILES names those of a run.
BENCHMARK_DATA_FILES = {
    "benchmarks.papers.translator.neural_translator": (
        "benchmarks/papers/translator/models/translator.json",
        "benchmarks/papers/translator/models/translator.onnx",
    ),
}


def code_of(command: str, root: Path = ROOT) -> dict[str, str]:
    """The digest of each room (such as `facade_core.parse`) of what a command imports: modules by their syntax, and their data.

    What a benchmark starts in a process of its own counts where it names it (`-m flows`, `-m benchmarks.readers`).
    """
    found = collect_modules(_starts(command, root), (), root, MEASURED)
    while more := {name for module in found.values() for name in _named(module.path, root)} - found.keys():
        found = collect_modules([*found, *more], (), root, MEASURED)
    data_files = {**DATA_FILES, **BENCHMARK_DATA_FILES}
    digests: dict[str, blake2b] = {}
    for name in sorted(found):
        digest = digests.setdefault(".".join(name.split(".")[:2]), blake2b(digest_size=4))
        digest.update(f"{name} {found[name].digest}\n".encode())
        for path in sorted(root / file for file in data_files.get(name, ())):
            digest.update(f"{path.relative_to(root).as_posix()}\n".encode() + bytes.fromhex(content_digest(path)))
    return {room: digest.hexdigest() for room, digest in digests.items()}


def changed(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """The rooms whose code is another, that are reached no longer, or that were not."""
    return sorted(room for room in {*then, *now} if then.get(room) != now.get(room))


def _starts(command: str, root: Path) -> list[str]:
    """The modules that a command begins with: of a package its `__main__`, and its modules that the command names."""
    program = next((program for program in COMMANDS if command.startswith(program)), None)
    if program is None:  # such as `make demo`
        return [WHOLE]
    name, *words = command.removeprefix(program).split()
    folder = root.joinpath("benchmarks", *name.split("."))
    parts = [word for word in ("__main__", *words) if (folder / f"{word}.py").is_file()]
    return [f"benchmarks.{name}", *(f"benchmarks.{name}.{part}" for part in parts)]


@cache
def _named(path: Path, root: Path) -> tuple[str, ...]:
    """The modules that a benchmark starts by their names, in a process of its own."""

    def started() -> Iterator[str]:
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                if node.value == "flows":
                    yield WHOLE
                elif (
                    node.value.startswith("benchmarks.")
                    and root.joinpath(*node.value.split(".")).with_suffix(".py").is_file()
                ):
                    yield node.value

    return tuple(started()) if path.relative_to(root).parts[0] == "benchmarks" else ()
