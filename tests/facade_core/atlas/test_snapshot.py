"""The atlas as xarray, over the packed store of this format."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from distributed import Client

import catalogs
from facade_core.atlas.journal import latest_chart_digests, read_journal
from facade_core.atlas.rasters import TexelLayout, chart_digests
from facade_core.atlas.snapshot import Atlas, open_atlas
from facade_core.atlas.store import commit, create_root, open_repository, open_root
from facade_core.core.errors import InputError, StoreError, StoreFormatError
from facade_core.core.provenance import Provenance
from facade_core.plan.plan_tables import read_plan
from tests.facade_core.atlas.stores import PACKED_STORE, unpack

TEXELS_PER_METRE = 3.0


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpack(PACKED_STORE, tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def atlas(out: Path) -> Atlas:
    return open_atlas(out)


def test_a_mean_is_lazy_and_in_the_stores_chunks(out: Path, atlas: Atlas) -> None:
    colour = atlas["atlas/colour"]
    assert colour.dims == ("page", "y", "x", "band")
    assert {dim: sizes[0] for dim, sizes in colour.chunksizes.items()} == {"page": 1, "y": 128, "x": 128, "band": 3}
    mean = colour.mean()
    assert mean.chunks is not None  # nothing was computed
    expected = atlas.group["atlas/colour"][:].mean()
    assert mean.compute().item() == pytest.approx(expected)
    assert open_atlas(out, chunks={"y": 2048, "x": 2048})["atlas/colour"].data.npartitions == 1
    assert open_atlas(out, chunks=None)["atlas/colour"].chunks is None


def test_a_mean_is_computed_on_a_cluster(atlas: Atlas) -> None:
    """In another process, to which the arrays, and the atlas itself, are sent."""
    here = atlas["atlas/provenance"].mean().compute().item()
    with Client(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None) as client:
        assert client.compute(atlas["atlas/provenance"].mean()).result().item() == pytest.approx(here)
        facade = client.submit(lambda sent: sent.facade("a-0").colour.values, atlas).result()
    np.testing.assert_array_equal(facade, atlas.facade("a-0").colour.values)


def test_charts_are_those_of_the_journal(atlas: Atlas) -> None:
    """Texels by their digests; the texels' centres where the plan has them."""
    plan = read_plan(atlas.session)
    placement, charts = plan.scene.placement, plan.scene.charts
    digests = latest_chart_digests(read_journal(atlas.group, "surfaces"))
    assert len(digests) > 5
    for row, number in enumerate(plan.ids.tolist()):
        id_ = f"{number:016x}"
        chart = atlas.chart(id_)
        assert chart.attrs == atlas.chart(row).attrs
        one = TexelLayout.of_charts(placement, [row])
        colour, provenance = chart.colour.values.reshape(-1, 3), chart.provenance.values.reshape(-1)
        assert chart_digests(colour, provenance, placement, one, plan.ids) == {id_: digests[id_]}
        last = chart.isel(y=-1, x=-1)
        world = np.array([last.world_x, last.world_y, last.world_z])
        x, y = (np.array([(extent[row] - 0.5) / TEXELS_PER_METRE]) for extent in (placement.width, placement.height))
        np.testing.assert_allclose(world, charts.points(row, x, y)[0])


def test_a_facade_says_what_is_known_of_it(atlas: Atlas) -> None:
    facade = atlas.facade("a-0")
    assert facade.attrs["facade"] == "a-0"
    assert facade.attrs["building"] == "a"
    assert (facade.attrs["kind"], facade.attrs["street"], facade.attrs["levels"]) == ("wall", "s1", 2)
    assert facade.attrs["floors"] == 2, "the exemplar is laid out to as many"
    assert facade.attrs["width"] == pytest.approx(12, abs=0.01)
    assert '"window"' in facade.attrs["elements"]
    assert float(facade.x[-1] + facade.x[0]) == pytest.approx(12, abs=1 / TEXELS_PER_METRE)
    assert (facade.provenance == Provenance.SYNTHESISED).all()  # an exemplar's
    assert "grid_mapping" not in atlas["atlas/colour"].attrs  # a page lies nowhere in the world


def test_attributes_are_those_of_cf(atlas: Atlas) -> None:
    labels = atlas["facade_maps/labels"]
    assert labels.dtype == labels.attrs["_FillValue"].dtype == labels.attrs["flag_values"].dtype == np.uint8
    assert labels.attrs["flag_meanings"].split()[:2] == ["wall", "window"]
    provenance = atlas["atlas/provenance"].attrs
    assert (
        dict(zip(provenance["flag_values"].tolist(), provenance["flag_meanings"].split(), strict=True))[
            Provenance.PHOTO
        ]
        == "photo"
    )
    assert atlas["charts/origin"].attrs["units"] == "m"
    for node in atlas.tree.subtree:
        for name, array in node.data_vars.items():
            assert array.attrs.get("long_name") or "exemplars" in node.path, f"{node.path}/{name}"
            assert not any(str(dim).startswith("dim_") for dim in array.dims)
            if "grid_mapping" in array.attrs:
                assert node[array.attrs["grid_mapping"]].attrs["grid_mapping_name"] == "transverse_mercator"


def test_a_facade_survives_cf_there_and_back(atlas: Atlas, tmp_path: Path) -> None:
    facade = atlas.facade("a-0").drop_encoding().load()
    decoded = xr.decode_cf(facade, decode_coords="all")
    unknown = facade.labels.values == 255
    np.testing.assert_array_equal(np.isnan(decoded.labels.values), unknown)
    facade.to_zarr(tmp_path / "facade.zarr", zarr_format=3, consolidated=False)
    again = xr.open_zarr(tmp_path / "facade.zarr", consolidated=False, decode_coords="all", chunks=None)
    assert {"world_x", "world_y", "world_z", "crs", "page"} <= set(again.coords)
    assert again.colour.encoding["grid_mapping"] == "crs"
    np.testing.assert_array_equal(again.labels, decoded.labels)
    again = xr.open_zarr(tmp_path / "facade.zarr", consolidated=False, mask_and_scale=False, chunks=None)
    xr.testing.assert_equal(again.load(), facade)


def test_at_a_tag_or_snapshot(tmp_path: Path) -> None:
    out = unpack(PACKED_STORE, tmp_path)
    repository = open_repository(out / "store")
    before = open_atlas(out / "store")
    repository.create_tag("handed over", before.snapshot)
    session = repository.writable_session("main")
    open_root(session)["atlas/colour"][0, :128, :128] = 9
    commit(session, "another colour")
    now = open_atlas(out)
    assert (now["atlas/colour"][0, :128, :128] == 9).all()
    for earlier in (now.at("handed over"), now.at(before.snapshot), pickle.loads(pickle.dumps(now)).at("handed over")):
        assert not (earlier["atlas/colour"][0, :128, :128] == 9).all()
    with pytest.raises(StoreError, match="no tag or snapshot handed on.*handed over"):
        now.at("handed on")
    *_, first = repository.ancestry(branch="main")
    with pytest.raises(StoreError, match=f"no tag or snapshot {first.id}"):
        now.at(first.id)  # before anything was written


def test_what_is_not_there_is_one_line(atlas: Atlas, tmp_path: Path) -> None:
    assert atlas.chart(np.int64(0)).identical(atlas.chart(0))
    with pytest.raises(InputError, match="no facade 3"):
        atlas.facade(3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no facade a-9; there are 4, the nearest is a-3"):
        atlas.facade("a-9")
    with pytest.raises(InputError, match="no chart 99; there are 22"):
        atlas.chart(99)
    with pytest.raises(StoreError, match="there is no store; run the block first"):
        open_atlas(tmp_path / "nothing")
    session = open_repository(tmp_path / "store", create=True).writable_session("main")
    create_root(session)
    commit(session, "nothing yet")
    with pytest.raises(StoreError, match="the block is not read yet"):
        open_atlas(tmp_path)


@pytest.mark.parametrize("format_", [1, 3, None])
def test_a_store_of_another_format_says_what_to_do(tmp_path: Path, format_: int | None) -> None:
    out = unpack(PACKED_STORE, tmp_path)
    session = open_repository(out / "store").writable_session("main")
    root = open_root(session)
    root.attrs["format"] = format_
    commit(session, "as another version")
    with pytest.raises(
        StoreFormatError, match=r"is of format (1|3|unknown), and .* reads 7; `streetloom run"
    ) as caught:
        open_atlas(out)
    assert str(out / "store") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_readmes_example(out: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Typed as it stands, with the names of this store."""
    readme = (Path(catalogs.__file__).parent / "README.md").read_text(encoding="utf-8")
    examples = [part.split("```")[0] for part in readme.split("```python\n")[1:]]
    (example,) = (example for example in examples if "open_atlas" in example)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "demo").symlink_to(out)
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(example.replace("w123949253-2", "a-0"), names)
    assert names["published"].snapshot == names["atlas"].snapshot
    assert names["grey"] == pytest.approx(names["atlas"]["atlas/colour"].values.mean())
    assert (tmp_path / "facade.zarr").is_dir()
    assert names["photo"].dtype == bool
