"""Every decision's measurement runs at toy size and shows what its record says, where that does not depend on the machine."""

from __future__ import annotations

import functools
import importlib
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks.decisions import DECISIONS

ROOT = Path(__file__).resolve().parents[2]
RECORDS = ROOT / "deploy" / "adr"


@functools.cache
def quick(name: str) -> dict[str, Any]:
    return importlib.import_module(f"benchmarks.decisions.{name}").measure(True, None)


def test_every_decision_has_a_record_that_names_its_command() -> None:
    for name, record in DECISIONS.items():
        assert f"streetloom bench decisions {name}" in (RECORDS / f"{record}.md").read_text(encoding="utf-8"), record


def test_every_command_in_a_record_exists_and_every_record_is_listed() -> None:
    listed = (RECORDS / "README.md").read_text(encoding="utf-8")
    for record in RECORDS.glob("0*.md"):
        assert f"({record.name})" in listed
        assert set(re.findall(r"bench decisions (\w+)", record.read_text(encoding="utf-8"))) <= set(DECISIONS)


def test_as_a_command_one_object_with_the_load_of_the_machine() -> None:
    """The one that needs a Prefect server and workers, so in a process of its own anyway."""
    command = [sys.executable, "-m", "benchmarks.decisions", "dispatch", "--quick"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    dispatch = json.loads(done.stdout)["decisions"]["dispatch"]
    assert dispatch["machine"].keys() >= {"cores", "load_before", "load_after"}
    assert set(dispatch["ms_per_unit_fanned_out"]) == {
        "client_map",
        "client_submit",
        "prefect_threads",
        "prefect_dask_runner",
    }
    assert dispatch["dask_runner_over_client_map"] > 0


def test_an_unknown_decision_is_refused_by_name() -> None:
    command = [sys.executable, "-m", "benchmarks.decisions", "speed"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert "speed" in done.stderr
    assert "dispatch" in done.stderr


def test_a_killed_icechunk_writer_leaves_a_whole_state() -> None:
    killed = quick("killed")
    assert killed["icechunk"]["whole"] == killed["kills"]
    assert sum(killed["plain_zarr"][state] for state in ("whole", "torn", "unreadable")) == killed["kills"]


def test_disjoint_chunks_are_kept_without_shards() -> None:
    kept = quick("ownership")["two_processes_disjoint_chunks"]
    assert kept["unsharded_kept"] == 1
    assert 0 < kept["sharded_kept"] <= 1  # how many are lost is a race


def test_merged_forks_lose_a_write_and_commits_refuse_it() -> None:
    assert quick("ownership")["two_writers_of_one_chunk"] == {"merged_forks_kept": 0.5, "second_commit_refused": 1.0}


def test_a_commit_grows_the_store_by_whole_chunks() -> None:
    commits = quick("commits")
    assert commits["commit_of_colour_chunks"]["10"]["growth_over_raw"] == pytest.approx(1, abs=0.1)
    assert commits["kb_for_one_texel"] > 128 * 128 * 3 / 1000
    assert commits["page"]["with_blend_state"]["bytes_per_texel"] > 30


def test_a_group_per_facade_makes_each_commit_larger() -> None:
    figures = quick("nodes")["facades"]["20"]
    assert figures["group_per_facade"]["metadata_kb_per_commit"] > figures["shared_arrays"]["metadata_kb_per_commit"]


def test_imports_are_timed_one_by_one() -> None:
    setup = quick("setup")
    assert min(setup["interpreter_seconds"], setup["help_seconds"], *setup["import_seconds"].values()) > 0
    assert set(setup["import_seconds"]) == {"icechunk", "zarr"}


def test_all_views_are_the_plain_average_and_gated_ones_are_not() -> None:
    departure = quick("weights")["departure_from_plain_average"]
    assert departure["literal_all_views"]["2"] > 0.1
    assert departure["literal_all_views"]["7"] == 0
    assert departure["gated_clamped_and_mapped"]["10"] > 0.5


def test_parsing_loads_no_torch() -> None:
    runtime = quick("runtime")
    assert runtime["torch_loaded_by_parse"] is False
    assert runtime["load_shipped_parser"]["memory_mb"] > 1


def test_a_loop_over_texels_is_measured_beside_numpy() -> None:
    texels = quick("texels")
    assert texels["python_over_numpy"] > 0
    assert texels["remap"]["seconds"] > 0


def test_a_viewpoint_sees_few_of_the_charts() -> None:
    rays = quick("rays")
    scene = rays["scenes"]["1200_triangles"]
    assert 0 < scene["charts_seen_within_40_m"] < scene["charts"] / 10
    assert 0 < rays["packing"]["planar_filled"] < 1


def test_both_catalogues_answer_alike() -> None:
    """The measurement compares the answers itself; there has to be one."""
    rows = quick("catalogue")["rows"]["50"]
    assert rows["found"] > 0
    assert rows["parquet_mb"] < rows["item_files_mb"]


def test_views_in_any_order_give_one_digest() -> None:
    assert quick("determinism")["views_in_any_order"]["digests_of_integer_state"] == 1


def test_by_rank_no_order_matters() -> None:
    texels = quick("ranks")["texels_that_depend_on_the_order"]
    assert texels["by_rank"] == 0
    assert texels["last_writer"] > 0.3


def test_readers_of_a_snapshot_never_see_two() -> None:
    seen = quick("publishing")
    assert seen["by_snapshot"]["reads"] == seen["by_snapshot"]["whole"] > 0


def test_split_manifests_make_commits_small() -> None:
    whole, split = quick("manifests")["60"].values()
    for unit in ("facade", "viewpoint"):
        assert 0 < split[unit]["kb"] < whole[unit]["kb"]
    assert split["manifests"] > whole["manifests"]
