"""The store: what is written is read back, commits are whole, lost writes are refused."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import icechunk
import numpy as np
import pytest
import xarray as xr
import zarr

from facade_core.atlas.arrays import STORE_FORMAT, create_arrays
from facade_core.atlas.journal import (
    atlas_digest,
    clear_record,
    read_journal,
    read_records,
    unit_key,
    write_record,
)
from facade_core.atlas.rasters import TexelLayout, chart_digests, describe_completeness, read_rasters, write_rasters
from facade_core.atlas.store import (
    PAGES_PER_MANIFEST,
    commit,
    create_root,
    expire_snapshots,
    open_repository,
    open_root,
)
from facade_core.core.atlas_spec import AtlasSpec
from facade_core.core.errors import StoreError
from facade_core.geometry.chart_packing import pack_charts

TEXELS = np.array([[300, 200], [20, 30], [25, 12], [140, 128], [60, 60]])
OWNER = np.array([0, 0, 0, 1, 1])


@pytest.fixture
def placement():
    return pack_charts(TEXELS, 1.0, OWNER, page=512, chunk=128, gutter=2)


@pytest.fixture
def repository(tmp_path: Path, placement):
    repository = open_repository(tmp_path / "store", create=True)
    session = repository.writable_session("main")
    create_arrays(
        create_root(session),
        AtlasSpec(placement.pages, 20.0, page=512),
        {"poses": 0, "exemplars": 1, "textures": 1, "facades": 3, "streets": 2, "surfaces": 5},
        crs="EPSG:32635",
    )
    commit(session, "arrays")
    return repository


def test_rasters_come_back_with_gutters(repository, placement) -> None:
    spec = AtlasSpec(placement.pages, 20.0, page=512)
    rasters = TexelLayout.of_charts(placement, [4, 0, 2])
    flat = np.random.default_rng(0).integers(0, 256, (rasters.total, 3), dtype=np.uint8)
    session = repository.writable_session("main")
    array = zarr.open_group(session.store)["atlas/colour"]
    write_rasters(array, spec, placement, rasters, flat)
    np.testing.assert_array_equal(read_rasters(array, placement, rasters), flat)
    first = flat[rasters.texel_slice(placement, 0)].reshape(200, 300, 3)
    y, x = int(placement.y[0]), int(placement.x[0])
    block = array[int(placement.page[0]), y - 2 : y + 202, x - 2 : x + 302]
    np.testing.assert_array_equal(block[0, 2:-2], first[0])
    np.testing.assert_array_equal(block[2:-2, -1], first[:, -1])


def test_small_charts_that_share_a_chunk_do_not_overwrite_each_other(repository, placement) -> None:
    spec = AtlasSpec(placement.pages, 20.0, page=512)
    session = repository.writable_session("main")
    array = zarr.open_group(session.store)["atlas/provenance"]
    for chart in (1, 2):
        one = TexelLayout.of_charts(placement, [chart])
        write_rasters(array, spec, placement, one, np.full(one.total, chart, np.uint8))
    for chart in (1, 2):
        assert (read_rasters(array, placement, TexelLayout.of_charts(placement, [chart])) == chart).all()


def test_two_workers_write_through_forks_and_one_commits(repository, placement) -> None:
    spec = AtlasSpec(placement.pages, 20.0, page=512)
    begun = []
    for chart in (0, 3):
        session = repository.writable_session("main")
        fork = pickle.loads(pickle.dumps(session.fork()))
        one = TexelLayout.of_charts(placement, [chart])
        write_rasters(
            zarr.open_group(fork.store)["atlas/provenance"], spec, placement, one, np.full(one.total, 7, np.uint8)
        )
        begun.append((session, pickle.loads(pickle.dumps(fork))))
    for index, (session, fork) in enumerate(begun):
        session.merge(fork)
        write_record(zarr.open_group(session.store), "facades", index, {"unit": str(index), "key": "k"})
        commit(session, f"unit {index}")
    group = zarr.open_group(repository.readonly_session("main").store, mode="r")
    for chart in (0, 3):
        assert (
            read_rasters(group["atlas/provenance"], placement, TexelLayout.of_charts(placement, [chart])) == 7
        ).all()
    assert [r and r["unit"] for r in read_journal(group, "facades")] == ["0", "1", None]


def test_two_units_on_one_chunk_are_refused_not_lost(repository, placement) -> None:
    sessions = [repository.writable_session("main") for _ in range(2)]
    for value, session in enumerate(sessions):
        zarr.open_group(session.store)["atlas/provenance"][0, value, 0] = 1
    commit(sessions[0], "one")
    with pytest.raises(StoreError, match="same chunk"):
        commit(sessions[1], "other")


def test_digest_sees_colour_and_provenance_and_nothing_else(repository, placement) -> None:
    session = repository.writable_session("main")
    group = zarr.open_group(session.store)
    digests = []
    for name, value in (("colour", 3), ("provenance", 4), ("street_views", 5)):
        group[f"atlas/{name}"][int(placement.page[3]), int(placement.y[3]) + 5, int(placement.x[3]) + 5] = value
        one = TexelLayout.of_charts(placement, [3])
        colour, provenance = (read_rasters(group[f"atlas/{n}"], placement, one) for n in ("colour", "provenance"))
        found = chart_digests(colour, provenance, placement, one, np.arange(len(placement.page), dtype=np.uint64))
        write_record(group, "surfaces", 0, {"unit": "a", "key": "k", "digests": found, "seconds": value})
        digests.append(atlas_digest(group))
    assert digests[0] != digests[1]
    assert digests[1] == digests[2]


@pytest.mark.parametrize("name", ["atlas", "facade_maps", "journal"])
def test_xarray_opens_every_group(repository, name) -> None:
    dataset = xr.open_zarr(repository.readonly_session("main").store, group=name, consolidated=False)
    assert len(dataset) > 0
    for array in dataset.values():
        assert array.attrs["long_name"]
        assert not any(str(dim).startswith("dim_") for dim in array.dims)


def test_expiry_keeps_the_newest_two_and_the_tagged_and_drops_the_rest(repository, tmp_path: Path) -> None:
    def noise(value: int) -> str:
        session = repository.writable_session("main")
        zarr.open_group(session.store)["atlas/colour"][0, :64, :64] = np.random.default_rng(value).integers(
            0, 256, (64, 64, 3)
        )
        return commit(session, str(value))

    def first(snapshot: str) -> int:
        return int(
            zarr.open_group(repository.readonly_session(snapshot_id=snapshot).store, mode="r")["atlas/colour"][
                0, 0, 0, 0
            ]
        )

    def size() -> int:
        return sum(f.stat().st_size for f in (tmp_path / "store").rglob("*") if f.is_file())

    snapshots = [noise(value) for value in range(6)]
    before = {snapshot: first(snapshot) for snapshot in snapshots}
    repository.create_tag("kept", snapshots[2])
    grown = size()
    expire_snapshots(repository)
    assert size() < grown - 3 * 32 * 64 * 3 * 0.9
    assert [first(snapshot) for snapshot in snapshots[4:]] == [before[snapshot] for snapshot in snapshots[4:]]
    assert first(repository.lookup_tag("kept")) == before[snapshots[2]]
    with pytest.raises(Exception, match=r"(?i)not found|does not exist|error"):
        first(snapshots[1])
    noise(7)


def test_records_are_read_by_unit_and_forgotten(repository) -> None:
    session = repository.writable_session("main")
    group = zarr.open_group(session.store)
    for index in (0, 2):
        write_record(group, "facades", index, {"unit": str(index), "key": "k"})
    assert [r and r["unit"] for r in read_records(group, "facades", np.array([2, 1, 0]))] == ["2", None, "0"]
    assert read_records(group, "facades", np.array([], np.int64)) == []
    clear_record(group, "facades", 2)
    assert read_records(group, "facades", np.array([2])) == [None]


def test_keys_change_with_what_they_stand_for() -> None:
    assert unit_key("a", {"x": 1, "y": 2}) == unit_key("a", {"y": 2, "x": 1})
    assert unit_key("a", 1) != unit_key("a", 2)


def test_no_store_is_one_line_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(StoreError) as caught:
        open_repository(tmp_path / "nothing")
    assert "nothing" in str(caught.value)
    assert "run the block" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("wrong", [{"page": 1000}, {"pages": 0}, {"gutter": 64}, {"texels_per_metre": 0}])
def test_unusable_specs(wrong: dict) -> None:
    with pytest.raises(StoreError):
        AtlasSpec(**({"pages": 1, "texels_per_metre": 20.0} | wrong))


PAGES = 2 * PAGES_PER_MANIFEST + 1


def _pages(repository: icechunk.Repository, count: int, *, written: slice = slice(None)) -> None:
    """A byte of every page that is written: its number, and one."""
    session = repository.writable_session("main")
    group = open_root(session)
    if "atlas/seed" in group:
        group["atlas/seed"].resize((count, 4))
    else:
        names = ("page", "y")
        group.create_array("atlas/seed", shape=(count, 4), chunks=(1, 4), dtype="uint8", dimension_names=names)
    group["atlas/seed"][written] = (np.arange(count, dtype=np.uint8)[:, None] + 1)[written]
    session.commit("pages", rebase_with=icechunk.ConflictDetector())


def _manifests(repository: icechunk.Repository) -> list[list[int]]:
    """From and to which page each manifest of the pages lists them, at the newest snapshot."""
    snapshot = json.loads(repository.inspect_snapshot(repository.lookup_branch("main")))
    node = next(node for node in snapshot["nodes"] if node["path"] == "/atlas/seed")
    return sorted(one["extents"][0] for one in node["manifest_refs"])


def _whole_manifests(path: Path) -> icechunk.Repository:
    """A store as it was opened before manifests were split."""
    return icechunk.Repository.open_or_create(icechunk.local_filesystem_storage(str(path)))


def test_a_commit_writes_only_the_manifests_of_the_pages_that_it_touches(tmp_path: Path) -> None:
    repository = open_repository(tmp_path / "store", create=True)
    _pages(repository, PAGES)
    assert _manifests(repository) == [
        [i, min(i + PAGES_PER_MANIFEST, PAGES)] for i in range(0, PAGES, PAGES_PER_MANIFEST)
    ]
    before = set((tmp_path / "store" / "manifests").iterdir())
    _pages(repository, PAGES, written=slice(1))
    assert len(set((tmp_path / "store" / "manifests").iterdir()) - before) == 1


def test_how_manifests_are_split_is_no_file_that_a_store_could_lose(tmp_path: Path) -> None:
    _pages(open_repository(tmp_path / "store", create=True), PAGES)
    assert not (tmp_path / "store" / "config.yaml").exists()


def test_a_store_with_whole_manifests_goes_on_with_split_ones_and_the_other_way_round(tmp_path: Path) -> None:
    old = _whole_manifests(tmp_path / "store")
    session = old.writable_session("main")
    create_root(session).attrs["format"] = STORE_FORMAT
    session.commit("root")
    _pages(old, PAGES)
    assert len(_manifests(old)) == 1
    for opened, count in ((open_repository, PAGES + 5), (_whole_manifests, PAGES + 7), (open_repository, 3)):
        before = open_root(open_repository(tmp_path / "store").readonly_session("main"))["atlas/seed"].shape[0]
        _pages(opened(tmp_path / "store"), count, written=slice(before, None))
        held = open_root(open_repository(tmp_path / "store").readonly_session("main"))["atlas/seed"][:]
        assert held[:, 0].tolist() == list(range(1, count + 1))
        assert (len(_manifests(old)) == 1) == (opened is _whole_manifests or count < PAGES_PER_MANIFEST)


def test_only_charts_with_texels_can_be_lost() -> None:
    nothing, some, all_of_them = np.zeros(3, np.uint8), np.uint8([0, 1, 2]), np.ones(3, np.uint8)
    assert describe_completeness([nothing, nothing]) == describe_completeness([]) == {}
    assert (
        describe_completeness([nothing, some])
        == describe_completeness([nothing, all_of_them])
        == {"is_complete": False}
    )
    assert describe_completeness([all_of_them, all_of_them > 0]) == {"is_complete": True}
