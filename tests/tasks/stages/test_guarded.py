"""Units read no file outside their inputs: each file that is opened while one is computed stands in its inputs."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from tasks.engine import processing
from tasks.engine.unit import Unit
from tasks.stages.exemplars import worker as exemplars
from tasks.stages.facades import worker as facades
from tests.pipeline.stages import texture, write_block, write_photo

ROOT = Path(__file__).resolve().parents[3]
# What Python, libraries and the networks load.
LOADED = (str(ROOT), sys.prefix, sys.base_prefix, "/usr", "/proc", "/sys", "/dev", "/etc")

_opened: list[str] = []
_is_guarded = [False]


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _is_guarded[0] and isinstance(arguments[0], str | bytes | Path):
        _opened.append(str(arguments[0]))


sys.addaudithook(_note)


@contextmanager
def guarded() -> Iterator[list[str]]:
    """Note the files that are opened within."""
    _opened.clear()
    _is_guarded[0] = True
    try:
        yield _opened
    finally:
        _is_guarded[0] = False


def files_of(value: Any) -> set[str]:
    """The files in some inputs."""
    if isinstance(value, Path):
        return {str(value)}
    if isinstance(value, Mapping):
        return set().union(*(files_of(one) for pair in value.items() for one in pair))
    if isinstance(value, tuple | list):
        return set().union(*map(files_of, value))
    if is_dataclass(value):
        return set().union(*(files_of(getattr(value, one.name)) for one in fields(value) if one.name != "run"))
    return set()


def test_no_unit_reads_a_file_that_its_inputs_do_not_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: dict[str, set[str]] = {}

    def check(compute: Callable[..., Any], inputs: Any, *arguments: Any) -> Any:
        with guarded() as opened:
            result = compute(*arguments)
        allowed = files_of(getattr(inputs, "_inputs", inputs))
        name = compute.__name__
        found.setdefault(name, set()).update(
            path for path in opened if path not in allowed and not path.startswith(LOADED)
        )
        return result

    process = processing.process_unit

    def process_guarded(compute: Any, write: Any, atlas: Any, unit: Unit[Any], **options: Any) -> Any:
        if compute.__name__ == "<lambda>":
            return process(compute, write, atlas, unit, **options)
        return process(lambda inputs: check(compute, inputs, inputs), write, atlas, unit, **options)

    prepare, pictured = exemplars.prepare_picture, facades.texture_from_pictures
    monkeypatch.setattr(processing, "process_unit", process_guarded)
    monkeypatch.setattr("tasks.stages.pictures.worker.process_unit", process_guarded)
    monkeypatch.setattr(exemplars, "prepare_picture", lambda inputs: check(prepare, inputs, inputs))
    monkeypatch.setattr(
        facades,
        "texture_from_pictures",
        lambda facade, inputs, refused: check(pictured, inputs, facade, inputs, refused),
    )
    folder = tmp_path / "in"
    write_block(folder)
    write_photo(folder, "a-0", 3)
    texture(write_block(folder), tmp_path / "out")
    assert {
        "prepare_picture",
        "texture_from_pictures",
        "compute_surface",
        "compute_page",
        "compute_tile",
    } <= found.keys()
    assert {name: files for name, files in found.items() if files} == {}


def test_a_file_outside_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.touch()
    with guarded() as opened:
        path.read_bytes()
    assert opened == [str(path)]
