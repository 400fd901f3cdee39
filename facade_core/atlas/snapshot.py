"""Snapshot of a store as an xarray tree, cut to charts and facades.

The tree has names, units and the CRS. All data is lazy.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import icechunk
import numpy as np

from facade_core.atlas.arrays import ARRAYS, PAGE_DIMS
from facade_core.atlas.journal import read_records
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.atlas.store_location import StoreLocation
from facade_core.atlas.table_schema import TABLES, TableValues
from facade_core.core.errors import InputError, StoreError
from facade_core.core.json_types import JsonObject
from facade_core.core.zarr_types import StoreGroup, get_subgroup
from facade_core.geometry.charts import CHART_KINDS

if TYPE_CHECKING:
    import xarray as xr

# CF names of world coordinates.
WORLD_COORDINATES = {
    "world_x": {"standard_name": "projection_x_coordinate", "units": "m"},
    "world_y": {"standard_name": "projection_y_coordinate", "units": "m"},
    "world_z": {"long_name": "height in the block's frame", "units": "m", "positive": "up"},
}
# Chunks of the store.
STORED_CHUNKS: Mapping[str, int] = {}


@dataclass(frozen=True, eq=False)
class Atlas:
    """Snapshot of a store, opened by `open_atlas`.

    Picklable for workers that reach the same store.

    Attributes
    ----------
    tree : groups and arrays of the store.
    session : session of the snapshot.
    path : folder of the store, None if unknown.
    chunks : Dask chunks, as in `open_atlas`.
    """

    tree: xr.DataTree
    session: icechunk.Session = field(repr=False)
    path: StoreLocation | None
    chunks: Mapping[str, int] | None = field(repr=False)

    def __getitem__(self, path: str) -> Any:
        """Return a group (DataTree) or an array (DataArray), such as `atlas["atlas/colour"]`."""
        return self.tree[path]

    @property
    def snapshot(self) -> str:
        """Return the snapshot's id."""
        return str(self.session.snapshot_id)

    @cached_property
    def group(self) -> StoreGroup:
        """Return the root group for zarr readers."""
        return open_root(self.session)

    def at(self, snapshot: str) -> Atlas:
        """Return the same store at another snapshot.

        Parameters
        ----------
        snapshot : id or tag.

        Raises
        ------
        StoreError
            The store has no such snapshot, or its folder is unknown.
        """
        if self.path is None:
            raise StoreError("the atlas was opened from a session of an unknown store; open a session at the snapshot")
        repository = open_repository(self.path)
        tags = repository.list_tags()
        try:
            snapshot_id = repository.lookup_tag(snapshot) if snapshot in tags else snapshot
            session = repository.readonly_session(snapshot_id=snapshot_id)
            return open_atlas(session, chunks=self.chunks)
        except (
            icechunk.IcechunkError,
            FileNotFoundError,
            ValueError,
        ) as error:  # the first snapshot of a store is empty
            known = ", ".join(sorted(tags)[:5]) or "none"
            raise StoreError(f"{self.path}: no tag or snapshot {snapshot} is there; tags are e.g. {known}") from error

    def chart(self, id: str | int | np.integer) -> xr.Dataset:
        """Return the rasters of a chart.

        Coordinates: y and x in metres down and right from the chart's upper left corner; world_x, world_y and world_z
        (y, x), the texel centres in the block's CRS; page. attrs: id, kind, first row and column on the page, origin,
        axis_x and axis_y (3,), texels_per_metre, crs.

        Parameters
        ----------
        id : 16 hexadecimal digits, as in the journal, or the row in `charts`.

        Raises
        ------
        InputError
            No chart has this id.
        """
        ids = [f"{number:016x}" for number in self.tables["charts"]["id"].tolist()]
        row = int(id) if isinstance(id, int | np.integer) else ids.index(id.lower()) if id.lower() in ids else -1
        if not 0 <= row < len(ids):
            raise InputError(f"no chart {id}; there are {len(ids)}, such as {ids[0]}")
        return self._cut(row, ids[row])

    def facade(self, id: str) -> xr.Dataset:
        """Return the rasters of a facade's chart, as in `chart`, with the facade's attributes.

        Further attrs: facade, building, street, width and height (m), floors, levels (by the map), seen, and elements:
        the completed facade's elements as JSON: class, left, top, right, bottom (texels), probability, depth (metres before the
        wall) and what it rests on.

        Raises
        ------
        InputError
            No facade has this id.
        """
        facades = self.tables["facades"]
        if id not in facades["id"]:
            near = get_close_matches(str(id), facades["id"], n=1, cutoff=0) or ["none"]
            raise InputError(f"no facade {id}; there are {len(facades['id'])}, the nearest is {near[0]}")
        row = facades["id"].index(id)
        record: JsonObject = dict(read_records(self.group, "facades", np.array([row]))[0] or {})
        levels = facades["floors"][row].item()
        return self.chart(int(facades["chart"][row])).assign_attrs(
            facade=id,
            building=self.tables["buildings"]["id"][facades["building"][row]],
            street=self.tables["streets"]["id"][facades["street"][row]],
            **{name: facades[name][row].item() for name in ("width", "height", "seen")},
            floors=record.get("floors") or levels,
            levels=levels,
            elements=json.dumps(record.get("elements", [])),
        )

    @cached_property
    def tables(self) -> Mapping[str, TableValues]:
        """Return the columns of the charts, facades, buildings and streets."""
        names = ("charts", "facades", "buildings", "streets")
        return {name: TABLES[name].read_columns(self.tree[name].to_dataset().compute()) for name in names}

    def _cut(self, row: int, id: str) -> xr.Dataset:
        import xarray as xr

        chart = {name: column[row] for name, column in self.tables["charts"].items() if np.ndim(column)}
        page, top, left, height, width = (int(chart[name]) for name in ("page", "y", "x", "height", "width"))
        window = {"page": page, "y": slice(top, top + height), "x": slice(left, left + width)}
        on_pages = [array.path.split("/") for array in ARRAYS if array.dims[:3] == PAGE_DIMS]
        rasters = {
            name: self.tree[folder][name].isel(window).assign_attrs(grid_mapping="crs") for folder, name in on_pages
        }
        frame = self.tree["atlas"].attrs
        density = float(chart["texels_per_metre"])
        down, right = ((np.arange(size) + 0.5) / density for size in (height, width))
        v, u = xr.DataArray(down, dims="y"), xr.DataArray(right, dims="x")
        if chunks := rasters["colour"].chunksizes:
            v, u = v.chunk({"y": chunks["y"]}), u.chunk({"x": chunks["x"]})
        world = {
            name: (chart["origin"][axis] + v * chart["axis_v"][axis] + u * chart["axis_u"][axis]).assign_attrs(attrs)
            for axis, (name, attrs) in enumerate(WORLD_COORDINATES.items())
        }
        return xr.Dataset(
            rasters,
            coords={
                "page": ((), page, {"long_name": "page of the atlas"}),
                "y": ("y", down, {"units": "m", "long_name": "down from the chart's upper left corner"}),
                "x": ("x", right, {"units": "m", "long_name": "right from the chart's upper left corner"}),
                **world,
            },
            attrs={
                "id": id,
                "kind": CHART_KINDS[int(chart["kind"])],
                "row": top,
                "column": left,
                "origin": chart["origin"].tolist(),
                "axis_x": chart["axis_u"].tolist(),
                "axis_y": chart["axis_v"].tolist(),
                "texels_per_metre": density,
                "crs": frame["crs"],
            },
        )


def open_atlas(
    source: icechunk.Session | StoreLocation | str, *, chunks: Mapping[str, int] | None = STORED_CHUNKS
) -> Atlas:
    """Open the store of a session, or the newest snapshot of a folder.

    Arrays have named dimensions, units, long names, flag meanings and a CF fill value. Values are read as stored;
    `xarray.decode_cf` replaces unknown values by NaN. Each group has its CRS as the coordinate `crs`.

    Parameters
    ----------
    source : session, folder of a store, or folder of a run. `catalogs.folder_at("s3://...")` gives a folder in a
        bucket.
    chunks : Dask chunks as in `xarray.open_zarr`. The default are the store's, which are small; {"y": 2048, "x": 2048}
        gives whole pages; None gives arrays without Dask.

    Raises
    ------
    StoreError
        There is no store, or it is empty.
    FormatError
        The store has another format.
    """
    import xarray as xr

    if isinstance(source, icechunk.Session):
        session = source
    else:
        folder = Path(source) if isinstance(source, str) else source
        session = open_repository(folder / "store" if (folder / "store").is_dir() else folder).readonly_session(BRANCH)
    repository = getattr(session, "repository", None)
    path = repository.path if repository else None
    if "atlas" not in (root := open_root(session)):
        raise StoreError(f"{path or 'the store'}: the block is not read yet; run it first")
    store: Any = session.store  # of zarr, which xarray's signature does not name
    groups = xr.open_groups(
        store, engine="zarr", consolidated=False, zarr_format=3, mask_and_scale=False, chunks=chunks
    )
    crs = _crs_attributes(str(root.attrs.get("crs", get_subgroup(root, "atlas").attrs["crs"])))
    tree = xr.DataTree.from_dict(
        {name: _with_declared_attributes(name.strip("/"), group, crs) for name, group in groups.items()}
    )
    return Atlas(tree, session, path, chunks)


def _with_declared_attributes(group: str, dataset: xr.Dataset, crs: Mapping[str, object]) -> xr.Dataset:
    """Add the declared attributes of the arrays and the CRS."""
    declared = {array.path: array.attrs for array in ARRAYS}
    if group in TABLES:
        placed = {True: {"grid_mapping": "crs"}, False: {}}
        columns = TABLES[group].columns
        declared = {f"{group}/{column.name}": {**column.attributes, **placed[column.is_position]} for column in columns}
    for name, variable in dataset.variables.items():
        variable.attrs = {**declared.get(f"{group}/{name}", {}), **variable.attrs}
        for of_its_type in {"_FillValue", "flag_values"} & set(variable.attrs):
            variable.attrs[of_its_type] = np.asarray(variable.attrs[of_its_type], variable.dtype)[()]
    return dataset.assign_coords(crs=((), np.int32(0), crs)) if "crs" in dataset.attrs else dataset


def _crs_attributes(name: str) -> dict[str, object]:
    """Return the CF attributes of a CRS."""
    from pyproj import CRS

    return dict(CRS.from_user_input(name).to_cf())
