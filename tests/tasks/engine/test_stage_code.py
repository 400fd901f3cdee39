"""What each stage's results stand on of the code: what it imports, models and libraries among it, and nothing else."""

from __future__ import annotations

import ast
import gc
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from facade_core.core import code_modules
from tasks.engine import stage_code as module
from tasks.engine.stage_code import CODE_PACKAGES, ROOT, code_version, stage_code_digest, worker_module
from tasks.stages.order import CODE_STAGES

Codes = Callable[[], dict[str, str]]


def worker_modules(stage: str) -> dict[str, code_modules.CodeModule]:
    """Modules that the digest of a stage counts."""
    return code_modules.collect_modules([worker_module(stage)], module.EXCLUDED_MODULES, ROOT, CODE_PACKAGES)


@pytest.fixture
def codes(tmp_path: Path) -> Codes:
    """The code of every stage of a copy of the house in tmp_path, as it is there when asked for."""
    for package in CODE_PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))

    def now() -> dict[str, str]:
        for cached in (stage_code_digest, code_modules.load_module, code_modules.content_digest):
            cached.cache_clear()
        found = {stage: stage_code_digest(stage, root=tmp_path) for stage in CODE_STAGES}
        return found

    return now


def test_a_change_reaches_the_stages_that_import_it(codes: Codes, tmp_path: Path) -> None:
    before = codes()
    facades = {"exemplars", "facades"}
    streets = {"streets"}
    for path, reached in {
        "facade_core/export/tiles/tile_model.py": {"tiles", "pictures", "publish"},
        "facade_core/export/tiles/block_tiles.py": {"pictures", "publish"},
        "facade_core/export/models/pages.py": {"pages", "tiles", "pictures", "publish"},
        "facade_core/export/pictures/stage_pictures.py": {"pictures"},
        "facade_core/street/surfaces.py": {"surfaces"},
        "facade_core/street/continuation.py": {"surfaces"} | streets,
        "facade_core/export/models/glb_merge.py": {"publish"},
        "facade_core/export/tiles/tileset.py": set(),  # only `streetloom export` takes it
        "catalogs/published/report.html.j2": {"publish"},
        "catalogs/readers/meshes/obj.py": set(),  # what is read is in the block's digest
        "catalogs/readers/pictures/aerial.py": {"ingest", "textures", "surfaces", "publish"} | streets,
        "tasks/engine/progress.py": set(),
        "facade_core/core/errors.py": set(),
        "facade_core/parsing/segmenter.py": facades | {"grounds", "walls"},
        "facade_core/parsing/models/network.json": facades
        | {"grounds", "walls", "publish"},  # the catalogue names the models
        "facade_core/parsing/models/network.onnx": facades | {"grounds", "walls", "publish"},
        "facade_core/parsing/models/network.md": set(),
        "facade_core/facade/layout/models/layouts.json": facades | {"publish"},
        "facade_core/facade/layout/models/layout_network.onnx": facades | {"publish"},
        "facade_core/imagery/poses/refinement.py": {"poses"},
        "facade_core/imagery/poses/joint_refinement.py": {"bundles"},
        "facade_core/geometry/buildings/facets.py": {"ingest"},
        "facade_core/facade/texture/genetic.py": {"facades"},
        "tasks/stages/shared/images.py": {"ingest", "poses", "bundles", "textures", "grounds", "walls", "surfaces"}
        | facades
        | streets,
        "tasks/stages/streets/worker.py": streets,
    }.items():
        content = (tmp_path / path).read_bytes()
        with (tmp_path / path).open("ab") as file:
            file.write(b"\nadded = 1\n")
        assert {stage for stage, code in codes().items() if code != before[stage]} == reached, path
        (tmp_path / path).write_bytes(content)
    assert codes() == before


@pytest.mark.long
def test_comments_layout_and_docstrings_do_not_count(codes: Codes, tmp_path: Path) -> None:
    before = codes()
    for path in [path for package in CODE_PACKAGES for path in (tmp_path / package).rglob("*.py")]:
        text = ast.unparse(ast.parse(path.read_text()))  # neither comments nor the layout are in a tree
        lines = text.replace('"""', '"""Told otherwise. ', 1) if text.startswith('"""') else text
        path.write_text(f"# all new\n{lines}\n")
    assert codes() == before


def test_imports_are_followed_to_where_a_name_is_defined(tmp_path: Path) -> None:
    for path, text in {
        "tasks/publish/task.py": "def made():\n    from facade_core.shapes import area\n    return area\n",
        "tasks/__init__.py": "",
        "facade_core/__init__.py": "",
        "facade_core/shapes/__init__.py": "from .square import area\nfrom facade_core.shapes.round import girth\n",
        "facade_core/shapes/square.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import facade_core.told\n",
        "facade_core/shapes/round.py": "",
        "facade_core/told.py": "",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    found = code_modules.collect_modules(["tasks.publish.task"], (), tmp_path, CODE_PACKAGES)
    assert set(found) == {"tasks.publish.task", "facade_core.shapes.square"}


def test_what_orders_and_runs_units_is_in_no_stage() -> None:
    for stage in CODE_STAGES:
        reached = worker_modules(stage)
        assert not reached.keys() & {
            f"tasks.{name}"
            for name in (
                "engine.compute.cluster",
                "engine.compute.connect",
                "engine.compute.worker_setup",
                "engine.fan_out",
                "stages.streets.task",
            )
        }


def test_ingest_depends_on_no_detector_and_no_parser() -> None:
    reached = worker_modules("ingest")
    assert not [name for name in reached if name.startswith(("facade_core.imagery.detect.", "facade_core.parsing."))]


def test_two_processes_agree_and_every_library_is_known() -> None:
    told = "from tasks.engine.stage_code import *; from tasks.stages.order import CODE_STAGES; print(code_version(CODE_STAGES))"
    command = [sys.executable, "-c", told]
    other = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    assert other == code_version(CODE_STAGES)
    libraries = {
        name.partition(".")[0]
        for stage in CODE_STAGES
        for one in worker_modules(stage).values()
        for name, _ in one.imports
    }
    libraries -= {*sys.stdlib_module_names, *CODE_PACKAGES, *module.EXCLUDED_LIBRARIES}
    assert {"numpy", "cv2", "onnxruntime", "maxflow", "shapely"} <= libraries
    assert [library for library in libraries if module._library_version(library) == "none"] == []


def test_one_thread_parses_at_a_time_and_without_the_garbage_collector(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python before 3.11.5 fails where the collector lets another thread parse meanwhile."""
    paths = sorted((ROOT / "facade_core").rglob("*.py"))[:16]
    parse, side_by_side, collected = ast.parse, [0], []

    def slow_parse(source: bytes) -> ast.Module:
        side_by_side.append(side_by_side[-1] + 1)
        time.sleep(0.005)
        collected.append(gc.isenabled())
        side_by_side.append(side_by_side[-1] - 1)
        return parse(source)

    monkeypatch.setattr(code_modules.ast, "parse", slow_parse)
    with ThreadPoolExecutor(8) as threads:
        found = list(threads.map(lambda path: code_modules._parse_module("facade_core.m", path, -1), paths))
    assert [one.path for one in found] == paths
    assert max(side_by_side) == 1
    assert not any(collected)
    assert gc.isenabled()
