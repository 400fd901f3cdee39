"""A run of a small block in which the files and arrays that units open, and the inputs that they read, are noted: prints JSON.

In a process of its own, as an audit hook cannot be taken away: `python -m tests.tasks.stages.guarded_run FOLDER`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from catalogs.block import read_block
from facade_core.atlas.journal import read_journal
from tasks.engine import processing
from tasks.engine.context import current_store, load_run_plan
from tasks.engine.inputs import CODE, digest_inputs, split_key
from tasks.engine.store.commits import open_newest_root
from tasks.engine.unit import Unit
from tasks.stages.exemplars import worker as exemplars
from tasks.stages.facades import worker as facades
from tasks.stages.order import STAGES_IN_ORDER
from tests.pipeline.stages import texture, write_block, write_photo

ROOT = Path(__file__).resolve().parents[3]
# What Python, libraries and the networks load.
LOADED = (str(ROOT), sys.prefix, sys.base_prefix, "/usr", "/proc", "/sys", "/dev", "/etc")

_opened: list[str] = []
_is_noting = [False]


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _is_noting[0] and isinstance(arguments[0], str | bytes | Path):
        _opened.append(str(arguments[0]))


@contextmanager
def note_opened_files() -> Iterator[list[str]]:
    _opened.clear()
    _is_noting[0] = True
    try:
        yield _opened
    finally:
        _is_noting[0] = False


class NotingGroup:
    """A store that notes the arrays that are opened."""

    def __init__(self, group: Any, arrays: set[str]) -> None:
        self._group = group
        self._arrays = arrays

    def __getitem__(self, path: str) -> Any:
        self._arrays.add(path)
        return self._group[path]

    def __contains__(self, path: str) -> bool:
        return path in self._group

    def __getattr__(self, name: str) -> Any:
        return getattr(self._group, name)


def list_files(value: Any) -> set[str]:
    """List the files in some inputs."""
    if isinstance(value, Path):
        return {str(value)}
    if isinstance(value, Mapping):
        return set().union(*(list_files(one) for pair in value.items() for one in pair))
    if isinstance(value, tuple | list):
        return set().union(*map(list_files, value))
    if is_dataclass(value):
        return set().union(*(list_files(getattr(value, one.name)) for one in fields(value) if one.name != "run"))
    return set()


def run_noted(folder: Path) -> dict[str, dict[str, list[str]]]:
    """Texture a block with a photo; returns files that functions open, in inputs and elsewhere, arrays, and unread inputs."""
    named: dict[str, set[str]] = {}
    arrays: dict[str, set[str]] = {}
    elsewhere: dict[str, set[str]] = {}

    def check(compute: Callable[..., Any], inputs: Any, *arguments: Any) -> Any:
        read = arrays.setdefault(compute.__name__, set())
        with note_opened_files() as opened, pytest.MonkeyPatch.context() as patch:
            patch.setattr("tasks.stages.shared.scene_view.current_store", lambda: NotingGroup(current_store(), read))
            result = compute(*arguments)
        allowed = list_files(getattr(inputs, "_inputs", inputs))
        named.setdefault(compute.__name__, set()).update(allowed.intersection(opened))
        elsewhere.setdefault(compute.__name__, set()).update(
            path for path in opened if path not in allowed and not path.startswith(LOADED)
        )
        return result

    process, prepare, pictured = processing.process_unit, exemplars.prepare_picture, facades.texture_from_pictures

    def process_noted(compute: Any, write: Any, atlas: Any, unit: Unit[Any], **options: Any) -> Any:
        if compute.__name__ == "<lambda>":  # an exemplar, prepared before
            return process(compute, write, atlas, unit, **options)
        return process(lambda inputs: check(compute, inputs, inputs), write, atlas, unit, **options)

    write_block(folder / "in")
    write_photo(folder / "in", "a-0", 3)
    block_file = write_block(folder / "in")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processing, "process_unit", process_noted)
        patch.setattr("tasks.stages.pictures.worker.process_unit", process_noted)
        patch.setattr(exemplars, "prepare_picture", lambda inputs: check(prepare, inputs, inputs))
        patch.setattr(
            facades,
            "texture_from_pictures",
            lambda facade, inputs, refused: check(pictured, inputs, facade, inputs, refused),
        )
        run = texture(block_file, folder / "out").run
    group, block, unread = open_newest_root(run), read_block(block_file), {}
    for stage in STAGES_IN_ORDER:
        records = [record for record in read_journal(group, stage.stage) if record]
        units = stage.list_units(run, block, load_run_plan(run), group)
        if units:
            read = {name for record in records for name in split_key(record["key"])}
            unread[stage.stage] = sorted({CODE, *digest_inputs(units[0].inputs)} - read)
    return {
        "named": {name: sorted(Path(file).name for file in files) for name, files in named.items()},
        "elsewhere": {name: sorted(files) for name, files in elsewhere.items() if files},
        "arrays": {
            name: sorted({path for path in paths if path.startswith(("atlas/", "facade_maps/"))})
            for name, paths in arrays.items()
        },
        "unread": unread,
    }


if __name__ == "__main__":
    sys.addaudithook(_note)
    print(json.dumps(run_noted(Path(sys.argv[1]))))
