"""What is known of a city's blocks: only what changed is due, and what did not is not read again."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from catalogs.block.reader import read_block
from catalogs.city.keys import uses_default_partition
from facade_core.core.errors import BlockFileError, InputError
from flows.cli.city import print_city_summary
from flows.cli.commands import command_line
from tasks.city import blocks
from tasks.city import city_log as accounts
from tasks.city.city_log import (
    BlockResult,
    CityLog,
    is_block_up_to_date,
    load_or_partition_city,
    read_city_log,
    write_block_result,
)
from tasks.city.source_digests import block_code_version
from tasks.stages.ingest.planning import make_plan
from tests.pipeline.stages import write_block

# Houses along one street, farther apart than context reaches.
HOUSES: dict[str, tuple[float, ...]] = {f"h{n}": (300 * n + 40, 5, 12, 6, 7.0) for n in range(4)}
STREETS = {"1": [(0, 0), (600, 0), (1200, 0)]} | {
    f"x{n}": [(300 * n, -50), (300 * n, 0), (300 * n, 50)] for n in range(5)
}


def town(folder: Path, houses: dict[str, tuple[float, ...]] = HOUSES, **keys: object) -> Path:
    block = write_block(folder, buildings=houses, streets=STREETS)
    (folder / "town.yaml").write_text(
        yaml.safe_dump(yaml.safe_load(block.read_text()) | {"cut": {"metres": 300}} | keys)
    )
    return folder / "town.yaml"


def test_a_house_that_changes_makes_those_due_that_read_it(tmp_path: Path) -> None:
    steps: list[str] = []
    before, files = load_or_partition_city(town(tmp_path), tmp_path / "out", steps.append)
    assert len(before.blocks) == 4
    assert steps == ["reading the city", f"cutting {len(HOUSES)} buildings into 4 blocks"]
    assert all((file.parent / yaml.safe_load(file.read_text())["part"]["path"]).is_file() for file in files.values())
    after, _ = load_or_partition_city(town(tmp_path, HOUSES | {"h1": (340, 5, 12, 6, 9.0)}), tmp_path / "out")
    changed = [name for name in before.digests if before.digests[name] != after.digests[name]]
    assert len(changed) == 1


def test_a_city_is_read_again_only_where_a_file_of_it_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, out = town(tmp_path), tmp_path / "out"
    found, _ = load_or_partition_city(file, out)

    def read_city(path: Path, out: Path, before: object, notify: object) -> None:
        raise AssertionError("read again")

    monkeypatch.setattr(accounts, "partition_city_file", read_city)
    again, _ = load_or_partition_city(file, out)
    assert again == read_city_log(out)
    assert again.digests == found.digests
    (tmp_path / "exemplars" / "0.labels.txt").write_text("one more")
    with pytest.raises(AssertionError, match="read again"):
        load_or_partition_city(file, out)


def test_who_asks_a_city_of_which_no_block_is_done_is_told_of_its_command(tmp_path: Path) -> None:
    load_or_partition_city(town(tmp_path), out := tmp_path / "out")
    for command in (["query", str(out)], ["metrics", str(out)], ["doctor", str(out)], ["catalog", str(out)]):
        said = CliRunner().invoke(command_line, command)
        assert f"`streetloom city CITY.yaml --out {out}`" in said.output, command


def test_what_was_assumed_of_a_whole_city_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At the end of its run and by the doctor: its blocks are read from extracts, which have no notes."""
    file, out = town(tmp_path, HOUSES | {"thin": (100, 5, 0, 6, 7.0)}, geoid_separation="auto"), tmp_path / "out"
    found, _ = load_or_partition_city(file, out)
    wanted = ("1 (thin)", "geoid_separation: ")
    assert all(any(words in note for note in found.notes) for words in wanted)
    assert list(read_city_log(out).notes) == list(found.notes)
    ended = {"seconds": 0, "blocks_skipped": 0, "estimate": {"processor_hours_taken": 0}}
    print_city_summary(found.summary(out) | ended)
    examined = CliRunner().invoke(command_line, ["doctor", str(out)]).output
    for said in (capsys.readouterr().out, examined):
        assert all(words in said for words in wanted)


def test_a_block_that_was_cut_is_told_to_be_one(tmp_path: Path) -> None:
    _, files = load_or_partition_city(town(tmp_path), tmp_path / "out")
    file = next(iter(files.values()))
    with pytest.raises(BlockFileError, match=f"`streetloom run {file}` textures it alone"):
        load_or_partition_city(file, tmp_path / "other")


def test_a_city_is_planned_with_the_facades_that_its_run_has(tmp_path: Path) -> None:
    """And so by the command, which says how far that was off of blocks that the model was not fitted on."""
    file = town(tmp_path)
    said = CliRunner().invoke(command_line, ["plan", str(file), "--json"], catch_exceptions=False)
    told = json.loads(said.stdout)
    _, files = load_or_partition_city(file, tmp_path / "out")
    assert told["facades"] == sum(len(make_plan(read_block(one)).facades) for one in files.values())
    off = told["fitted"]["error_planned"]
    printed = CliRunner().invoke(command_line, ["plan", str(file)], catch_exceptions=False).stdout
    assert f"at most {off['seconds']:.0%} of the seconds" in printed
    assert re.search(r"time +\d+ (s|min) \(\d+ (s|min) to \d+ (s|min)\) with 2 workers", printed)
    assert f"{told['exemplars']} exemplars" in printed


def test_a_block_file_is_cut_as_usual(tmp_path: Path) -> None:
    assert not uses_default_partition(town(tmp_path))
    assert uses_default_partition(tmp_path / "block.yaml")


def test_blocks_that_a_new_cut_does_not_have_are_put_away(tmp_path: Path) -> None:
    load_or_partition_city(town(tmp_path), tmp_path / "out")
    (tmp_path / "out" / "blocks" / "x1y1" / "store").mkdir(parents=True)
    load_or_partition_city(town(tmp_path, cut={"metres": 5000}), tmp_path / "out")
    assert not list((tmp_path / "out" / "blocks").iterdir())
    assert (tmp_path / "out" / ".gone" / "x1y1" / "store").is_dir()


def test_a_block_stands_where_it_was_done_by_this_code_of_what_it_reads(tmp_path: Path) -> None:
    folder = tmp_path / "blocks" / "a" / "published" / "S1"
    folder.mkdir(parents=True)
    for name in ("items.parquet", "summary.json"):
        (folder / name).touch()
    (tmp_path / "blocks" / "a" / "current").write_text("S1\n")
    done = BlockResult(code=0, digest="d", version=block_code_version(), snapshot="S1")
    assert is_block_up_to_date(tmp_path, "a", done, "d")
    assert is_block_up_to_date(tmp_path, "a", replace(done, code=1), "d"), "what its input spoils fails again"
    assert not is_block_up_to_date(tmp_path, "a", done, "d", tiles=True)
    (tmp_path / "blocks" / "a" / "exports" / "3dtiles").mkdir(parents=True)
    (tmp_path / "blocks" / "a" / "exports" / "3dtiles" / "tileset.json").touch()
    assert is_block_up_to_date(tmp_path, "a", replace(done, tiles="S1"), "d", tiles=True)
    assert not is_block_up_to_date(tmp_path, "a", replace(done, tiles="S0"), "d", tiles=True), (
        "of what it published before"
    )
    others = [{"code": 2}, {"digest": "e"}, {"version": "0"}, {"snapshot": "S0"}]
    assert not any(is_block_up_to_date(tmp_path, "a", replace(done, **one), "d") for one in others)  # type: ignore[arg-type]


def test_what_cannot_be_read_is_known_of_no_block(tmp_path: Path) -> None:
    (tmp_path / "city.json").write_text(json.dumps({"name": "a", "colour": 3}))
    assert read_city_log(tmp_path) == CityLog("")


def test_each_block_has_a_record_of_its_own(tmp_path: Path) -> None:
    account, _ = load_or_partition_city(town(tmp_path), tmp_path / "out")
    held = (tmp_path / "out" / "city.json").stat()
    one, other, *_ = account.blocks
    how = BlockResult(0, digest="d", snapshot="S1", summary={"facades_done": 3}, seconds=2.0)
    write_block_result(tmp_path / "out", one, how)
    write_block_result(tmp_path / "out", other, BlockResult(1, reason="cut"))
    (tmp_path / "out" / "blocks" / other / "ended.json").write_text("{cut")
    assert (tmp_path / "out" / "city.json").stat().st_ino == held.st_ino, "the cost of a block is not all blocks'"
    assert read_city_log(tmp_path / "out").blocks == {**account.blocks, one: how}, (
        "of a damaged record nothing is known"
    )


def test_failed_blocks_are_told_and_the_others_added_up(tmp_path: Path) -> None:
    ended = {
        "a": BlockResult(0, summary={"facades_done": 3}),
        "b": BlockResult(2, reason="no streets"),
        "c": BlockResult(),
    }
    summary = CityLog("town", blocks=ended).summary(tmp_path)
    assert (summary["blocks"], summary["blocks_done"], summary["facades_done"]) == (3, 1, 3)
    assert summary["failures"] == [{"unit": "block b", "reason": "no streets", "code": 2}]
    assert summary["left"] == ["c"]


def test_two_cities_do_not_share_a_folder(tmp_path: Path) -> None:
    load_or_partition_city(town(tmp_path / "a"), tmp_path / "out")
    with pytest.raises(InputError, match="holds city small; give city other a folder"):
        load_or_partition_city(town(tmp_path / "b", name="other"), tmp_path / "out")
    (tmp_path / "run" / "store").mkdir(parents=True)
    with pytest.raises(InputError, match="holds the run of a block"):
        load_or_partition_city(town(tmp_path / "a"), tmp_path / "run")


def test_block_files_of_the_users_are_read_again_only_where_they_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, height in (("a", 7.0), ("b", 9.0)):
        write_block(tmp_path / name, buildings={"h": (4, 5, 12, 6, height)}, streets={"1": [(0, 0), (45, 0)]})
        (tmp_path / name / "block.yaml").rename(tmp_path / name / f"{name}.yaml")
    (tmp_path / "blocks").mkdir()
    for name in "ab":
        keys = yaml.safe_load((tmp_path / name / f"{name}.yaml").read_text())
        for one in (keys["buildings"], keys["streets"], keys["imagery"]["exemplars"]):
            one["path"] = f"../{name}/{one['path']}"
        (tmp_path / "blocks" / f"{name}.yaml").write_text(yaml.safe_dump(keys))
    (tmp_path / "blocks" / "none.yaml").write_text("name: none")
    (tmp_path / "out").mkdir()
    (tmp_path / "city.yaml").write_text("name: c\nblocks: {path: blocks}")
    found, files = load_or_partition_city(tmp_path / "city.yaml", tmp_path / "out")
    assert list(files) == ["a", "b", "none"]
    assert found.digests["none"] == ""
    read: list[str] = []
    monkeypatch.setattr(blocks, "read_block", lambda file: (read.append(file.stem), read_block(file))[1])
    assert load_or_partition_city(tmp_path / "city.yaml", tmp_path / "out")[0] == found
    assert read == ["none"]
    write_block(tmp_path / "b", buildings={"h": (4, 5, 12, 6, 12.0)}, streets={"1": [(0, 0), (45, 0)]})
    after, _ = load_or_partition_city(tmp_path / "city.yaml", tmp_path / "out")
    assert read == ["none", "b", "none"]
    assert after.digests["a"] == found.digests["a"]
    assert after.digests["b"] != found.digests["b"]
