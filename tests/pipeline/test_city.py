"""A city of two blocks, as a user runs it: killed on the way, gone on with, and asked again with nothing to do."""

from __future__ import annotations

import json
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import pytest
import yaml

from catalogs.published.merged_items import read_merged_items_headers
from catalogs.query.execution import query
from flows.city import city as flow
from flows.city_options import next_time_of_day
from tasks.engine.store.commits import read_newest_journal
from tasks.export.formats import export_run
from tests.pipeline.runs import PATIENCE_S, ROOT, environment, working_in
from tests.pipeline.stages import write_block
from tests.pipeline.test_cluster import wait_until

pytestmark = pytest.mark.long

# A house on either side of where the city is cut, and a street past both.
HOUSES = {"a": (4, 5, 12, 6, 7.0), "b": (74, 5, 12, 6, 9.0)}
STREETS = {"1": [(0, 0), (45, 0), (90, 0)]}


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("town")
    block = write_block(folder, buildings=HOUSES, streets=STREETS)
    keys = yaml.safe_load(block.read_text()) | {"name": "town", "cut": {"metres": 70}}
    (folder / "town.yaml").write_text(yaml.safe_dump(keys))
    return folder / "town.yaml"


def command(town: Path, *more: str) -> list[str]:
    out = town.parent / "out"
    return [sys.executable, "-m", "flows", "city", str(town), "--out", str(out), "--workers", "1", "--json", *more]


def run(town: Path, *more: str, expect: int = 0) -> dict:
    done = subprocess.run(
        command(town, *more), cwd=ROOT, env=environment(town.parent), capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.returncode == expect, done.stderr[-3000:]
    return json.loads(done.stdout.strip().splitlines()[-1])


def test_a_city_goes_on_after_a_kill_and_has_nothing_to_do_afterwards(town: Path) -> None:
    out = town.parent / "out"
    process = subprocess.Popen(
        command(town, "--no-tiles"), cwd=ROOT, env=environment(town.parent), stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if " to go" in line:  # the first block is done, the other has begun
            break
    process.kill()
    process.stderr.close()
    process.wait()
    blocks = json.loads((out / "city.json").read_text())["digests"]
    [begun] = [name for name in blocks if not (out / "blocks" / name / "ended.json").is_file()]
    assert len(blocks) == 2
    wait_until(lambda: not working_in(out / "blocks" / begun))  # the block that had begun ends with the city

    summary = run(town)
    assert (summary["blocks"], summary["blocks_done"], summary["blocks_skipped"]) == (2, 2, 0), (
        "no tiles were asked for"
    )
    assert summary["units_skipped"] > 0
    assert not summary["failures"]
    assert set(query(out)["building"]) == {"a", "b"}
    assert len(json.loads((out / "tileset.json").read_text())["root"]["children"]) == 2
    assert [len(one.runs) for one in read_merged_items_headers(out)] == [2]
    assert (out / "overview.glb").is_file()
    assert summary["estimate"]["facades"] > 0

    exported = export_run(out, "cityjsonseq", town.parent / "exported")
    features = [json.loads(line) for line in exported.files[0].read_text().splitlines()[1:]]  # type: ignore[union-attr]
    things = [id for one in features for id, thing in one["CityObjects"].items() if thing["type"] == "Building"]
    assert sorted(things) == ["a", "b"], "each in the block that owns it, under its own id"
    assert not exported.notes
    header = json.loads(exported.files[0].read_text().splitlines()[0])  # type: ignore[union-attr]
    assert ".npz" not in header["+metadata-extended"]["constraints"]["userNote"], "the parts of a city are no source"

    again = run(town)
    assert (again["blocks_done"], again["blocks_skipped"]) == (2, 2)
    assert again["atlas_digest"] == summary["atlas_digest"]

    facade = query(out, where="building = 'b' and role = 'street'")["id"].iloc[0]
    said = {"facade_id": facade, "elements": [["door", 0.4, 0.7, 0.5, 1.0]]}
    (town.parent / "said.json").write_text(json.dumps({"corrections": [said]}))
    importing = [sys.executable, "-m", "flows", "import", str(out), str(town.parent / "said.json"), "--who", "anna"]
    done = subprocess.run(importing, cwd=ROOT, env=environment(town.parent), capture_output=True, text=True, check=True)
    assert f"streetloom city {town} --out {out}" in done.stdout + done.stderr
    corrected = run(town)
    assert (corrected["blocks_done"], corrected["blocks_skipped"]) == (2, 1), "of that block alone"
    assert query(out, where="corrected = 1")["id"].tolist() == [facade]
    assert run(town)["blocks_skipped"] == 2


def test_blocks_side_by_side_share_their_workers_and_exemplars(town: Path, tmp_path: Path) -> None:
    """And their results are those of one block after the other."""
    words = [sys.executable, "-m", "flows", "city", str(town), "--no-tiles", "--json", "--out"]
    alone, together = tmp_path / "alone", tmp_path / "together"
    found = {}
    for out, more in ((alone, ("--workers", "1", "--at-once", "1")), (together, ("--workers", "2", "--at-once", "2"))):
        done = subprocess.run(
            [*words, str(out), *more], cwd=ROOT, env=environment(tmp_path), capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr[-3000:]
        found[out] = json.loads(done.stdout.strip().splitlines()[-1])
        assert len(list((out / "shared" / "exemplars").iterdir())) == 2
    assert found[alone]["atlas_digest"] == found[together]["atlas_digest"]
    assert found[together]["estimate"]["processor_hours_taken"] > 0
    assert not list(tmp_path.rglob("preview.jpg")), "the page of a city shows its finished blocks"
    preparing = [
        len(_prepared_exemplars(alone / "blocks" / name))
        for name in json.loads((alone / "city.json").read_text())["digests"]
    ]
    assert sorted(preparing) == [0, 2], "each by the first block that needs it"


def _prepared_exemplars(out: Path) -> list[str]:
    """Exemplars of a block that it prepared itself."""
    records = read_newest_journal(out / "store", "exemplars")
    return [record["unit"] for record in records if record and "scale" in record["seconds"]]


def test_the_nightly_city_is_deployed_as_its_flow_takes_it() -> None:
    entries = yaml.safe_load((ROOT / "deploy" / "prefect.yaml").read_text())["deployments"]
    (nightly,) = [entry for entry in entries if entry["entrypoint"] == "flows.city:city"]
    flow.validate_parameters(nightly["parameters"])
    assert next_time_of_day(nightly["parameters"]["until"], datetime(2026, 11, 24, 2, 0)) == datetime(
        2026, 11, 24, 6, 0
    )
    assert nightly["concurrency_limit"] == {"limit": 1, "collision_strategy": "CANCEL_NEW"}
