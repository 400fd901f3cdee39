"""What the doctor says of a folder that is well, damaged, stale or unfinished, and of an environment."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
import zarr
from click.testing import CliRunner

from catalogs.block.reader import read_block
from catalogs.published.snapshot import current_snapshot
from facade_core.atlas.journal import clear_record
from facade_core.atlas.store import BRANCH, commit, open_repository
from flows.cli.commands import command_line
from flows.lock import lock_folder
from tasks.doctor import examine_folder, examine_machine
from tasks.doctor.machine import check_disk, check_models, check_packages
from tasks.engine.run import Run
from tasks.engine.run_key import create_run
from tasks.engine.store.integrity import is_store_marked_suspect, repair_store
from tasks.engine.store.status import record_run_block_file
from tasks.stages.ingest.task import ingest_block
from tests.pipeline.stages import stored_view


def wrong(out: Path) -> dict[str, str]:
    return {finding.concern: finding.message for finding in examine_folder(out) if finding.is_well is False}


def contents(out: Path) -> set[str]:
    return {path.relative_to(out).as_posix() for path in out.rglob("*")}


def garble_view(run: Run) -> None:
    session = open_repository(run.store).writable_session(BRANCH)
    group = zarr.open_group(session.store)
    view = group[stored_view(group)]
    view[:] = 255 - view[:]
    commit(session, "garbled")


def lose_view(run: Run) -> None:
    session = open_repository(run.store).writable_session(BRANCH)
    group = zarr.open_group(session.store)
    del group[stored_view(group)]
    commit(session, "lost")


def forget_street(run: Run) -> None:
    session = open_repository(run.store).writable_session(BRANCH)
    clear_record(zarr.open_group(session.store), "streets", 1)
    commit(session, "forgotten")


def lose_exemplar(run: Run) -> None:
    session = open_repository(run.store).writable_session(BRANCH)
    exemplars = zarr.open_group(session.store)["exemplars"]
    del exemplars[f"{min(exemplars.group_keys())}/labels"]
    commit(session, "lost")


def lose_model(run: Run) -> None:
    out = Path(run.out)
    current_snapshot(out).model.unlink()


def cut_snapshot(run: Run) -> None:
    path = run.store / "snapshots" / open_repository(run.store).lookup_branch(BRANCH)
    path.write_bytes(path.read_bytes()[:50])


@pytest.mark.long
@pytest.mark.parametrize(
    ("damage", "concern", "said"),
    [
        (garble_view, "store", "texels differ from the digests of their records"),
        (lose_view, "store", "records without their data: 1 streets"),
        (lose_exemplar, "store", "records without their data: 1 exemplars"),
        (forget_street, "units", " done, 1 waiting"),
        (lose_model, "published", "block.glb is missing"),
        (cut_snapshot, "store", "the newest snapshot cannot be read"),
    ],
)
def test_what_is_damaged_is_said_with_what_mends_it(
    run: Run, damage: Callable[[Run], None], concern: str, said: str
) -> None:
    out = Path(run.out)
    damage(run)
    found = wrong(out)
    assert said in found[concern]
    assert f"--out {out}`" in found[concern]
    assert "\n" not in found[concern]
    if damage is garble_view:
        assert is_store_marked_suspect(out)  # no size shows it: the next run looks at everything
        assert "lost what they made" in repair_store(run)[0]


@pytest.mark.long
def test_nothing_is_wrong_with_a_whole_run_until_its_block_changes(
    textured: tuple[Path, Run], run: Run, tmp_path: Path
) -> None:
    out = Path(run.out)
    assert wrong(out) == {}
    block = shutil.copytree(textured[0].parent, tmp_path / "block") / "block.yaml"
    record_run_block_file(out, block)
    before = contents(out)
    assert wrong(out) == {}
    settings = yaml.safe_load(block.read_text())
    block.write_text(yaml.safe_dump(settings | {"seed": 4}))
    assert wrong(out) == {}, "what is stale is whole"
    [said] = [
        finding.message for finding in examine_folder(out) if finding.concern == "stale" and finding.is_well is None
    ]
    assert "streets (block's settings changed)" in said
    assert said.endswith(f"the next run processes it: `streetloom run {block} --out {out}`")
    planned = CliRunner().invoke(command_line, ["plan", str(block), "--out", str(out)])
    assert planned.exit_code == 0
    assert planned.output.strip() == said.partition("; the next run")[0]
    block.write_text(yaml.safe_dump(settings | {"name": "other"}))
    assert "is block other; the folder holds" in wrong(out)["stale"]
    block.unlink()
    assert "block.yaml" in wrong(out)["stale"]
    assert contents(out) == before


def test_the_environment_is_as_declared(tmp_path: Path) -> None:
    assert [f for f in examine_machine(tmp_path / "not" / "yet") if f.is_well is False] == []


def test_what_the_environment_lacks_is_told(tmp_path: Path) -> None:
    from facade_core.parsing import network

    missing, *_ = check_packages(["numpy<1", "not-there>=2", "torch>=9; extra == 'train'"])
    assert missing.is_well is False
    assert "is not <1, not-there is missing; `make setup`" in missing.message
    for path in network.SHIPPED_NETWORK.parent.glob("network.*"):
        shutil.copy(path, tmp_path)
    (tmp_path / "network.onnx").write_bytes(b"cut")
    whole, cut = check_models(
        {network.SHIPPED_NETWORK: network.load_network, tmp_path / "network.onnx": network.load_network}
    )
    assert whole.is_well
    assert cut.is_well is False
    assert "checksum" in cut.message
    assert check_disk(tmp_path, 1).is_well
    assert "make room" in check_disk(tmp_path / "not" / "yet", 1 << 60).message


def test_the_command_exits_by_what_it_found(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tasks.doctor.examine_machine", lambda folder: ())
    assert CliRunner().invoke(command_line, ["doctor"]).exit_code == 0
    lose_model(run)
    shown = CliRunner().invoke(command_line, ["doctor", run.out, "--json"])
    assert shown.exit_code == 1
    told = json.loads(shown.output)
    assert told["ok"] is False
    assert {"published": "wrong", "units": "ok"}.items() <= {f["concern"]: f["state"] for f in told["findings"]}.items()
    with lock_folder(Path(run.out)):
        shown = CliRunner().invoke(command_line, ["doctor", run.out])
    assert shown.exit_code == 2
    assert "a run is at work in it" in shown.output


def box(x: float, *, z: float | None = None) -> list[list[float]]:
    """Return a closed ring of 10 x 10 m, in metres."""
    corners = [(x, 0), (x + 10, 0), (x + 10, 10), (x, 10), (x, 0)]
    return [[385_000 + a, 6_671_000 + b, *([] if z is None else [z])] for a, b in corners]


def write_block_with_notes(folder: Path) -> Path:
    """Write a block whose inputs have a note of each of six kinds."""

    def feature(id: str, geometry: dict[str, object], **tags: object) -> dict[str, object]:
        return {"type": "Feature", "properties": {"id": id, **tags}, "geometry": geometry}

    ring, top = box(80, z=10.0), box(80, z=20.0)
    walls = [[[ring[i], ring[i + 1], top[i + 1], top[i], ring[i]]] for i in range(4)]
    features = [
        feature("tall", {"type": "Polygon", "coordinates": [box(0)]}, building="yes", height=9),
        feature("assumed", {"type": "Polygon", "coordinates": [box(20)]}, building="yes"),
        feature("carport", {"type": "Polygon", "coordinates": [box(40)]}, building="roof"),
        feature("garage", {"type": "Polygon", "coordinates": [box(60)]}, building="yes", location="underground"),
        feature("open", {"type": "MultiPolygon", "coordinates": walls}, building="yes"),
    ]
    folder.mkdir()
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3067"}}
    content = {"type": "FeatureCollection", "crs": crs, "features": features}
    (folder / "buildings.geojson").write_text(json.dumps(content))
    (folder / "block.corrections.jsonl").write_text('{"id": "gone", "what": "height", "value": 9}\n')
    keys = {"name": "noted", "crs": "EPSG:3067", "buildings": {"path": "buildings.geojson"}}
    (folder / "block.yaml").write_text(
        yaml.safe_dump(keys | {"texture": {"walls": "translate", "texels_per_metre": 4}})
    )
    return folder / "block.yaml"


def test_every_note_of_the_inputs_is_named(tmp_path: Path) -> None:
    source = write_block_with_notes(tmp_path / "block")
    block, out = read_block(source), tmp_path / "out"
    out.mkdir()
    record_run_block_file(out, source)
    run = create_run(block, out)
    ingest_block.fn(run, block)
    said = CliRunner().invoke(command_line, ["doctor", str(out)]).output
    notes = [line.split(maxsplit=2)[2] for line in said.splitlines() if line.startswith("note   inputs")]
    for id in ("carport", "garage", "open", "gone"):
        assert any(f"({id})" in note for note in notes), (id, notes)
    for words in ("state no height", "derived from the gaps between buildings"):
        assert any(words in note for note in notes), (words, notes)
    assert set(block.notes) <= set(notes)
    assert len(notes) >= 6


def test_a_printed_command_can_be_pasted(tmp_path: Path) -> None:
    out = tmp_path / "my run"
    out.mkdir()
    assert f"`streetloom run BLOCK.yaml --out '{out}'` makes one" in wrong(out)["store"]
