"""Catalogue of published runs for Python: GeoDataFrame of facades, Dataset of one facade."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from catalogs.printable_text import normal_form
from catalogs.published.folders import Folder
from catalogs.published.runs import find_runs
from catalogs.published.s3 import folder_at
from catalogs.published.snapshot import SnapshotFolder, current_snapshot
from catalogs.query.execution import query
from catalogs.query.formats import to_geodataframe
from facade_core.core.arrays import AnyArray
from facade_core.core.errors import InputError
from facade_core.core.zarr_types import StoreGroup, get_subgroup

if TYPE_CHECKING:
    import geopandas as gpd
    import xarray as xr

# Variable of a facade's Dataset -> array of the store.
RASTERS = {
    "colour": "atlas/colour",
    "provenance": "atlas/provenance",
    "texture": "atlas/seed",
    "evidence": "facade_maps/evidence",
    "labels": "facade_maps/labels",
    "occluded": "facade_maps/occluded",
    "confidence": "facade_maps/confidence",
}


@dataclass(frozen=True)
class Catalogue:
    """Published results of the runs in a folder on this machine or in a bucket."""

    out: Folder

    def search(
        self, where: str | None = None, *, bbox: Sequence[float] | None = None, since: str | None = None
    ) -> gpd.GeoDataFrame:
        """Return the selected facades and units set aside; geometry are foot lines in lon/lat.

        Arguments are those of `catalogs.query.query`.

        Raises
        ------
        InputError : one line that names the argument.
        """
        try:
            return to_geodataframe(query(self.out, where=where, bbox=bbox, since=since))
        except InputError as error:  # messages name command-line options, which equal the arguments
            raise InputError(str(error).removeprefix("--")) from error

    def facade(self, id: str, *, run: str | None = None) -> xr.Dataset:
        """Return the rasters (y, x) of a facade in the current snapshot.

        Coordinates are metres along the wall and down from its top. attrs: id, crs, origin (3,) of its upper left
        corner, axis_x and axis_y (3,), elements of the completed facade as JSON. to_zarr keeps the Dataset as it is.
        NetCDF 3, which xarray writes without netCDF4 and h5netcdf, has no unsigned bytes:
        `facade.astype("int16").to_netcdf(path)` works everywhere.

        Parameters
        ----------
        id : id of the facade.
        run : name of the run, as in the column `run`; needed if several runs have a facade of that id.

        Raises
        ------
        InputError : no such facade.
        StoreError : the run's store is gone.
        """
        with current_snapshot(self._find_folder(id, run)).hold_for_reading() as snapshot:
            return _read_facade(snapshot, normal_form(id))

    def _find_folder(self, id: str, run: str | None) -> Folder:
        rows = query(self.out, where="kind = 'facade'")
        rows = rows[rows["id"] == normal_form(id)]
        if run is not None:
            rows = rows[rows["run"] == run]
        names = rows["run"].tolist()
        if not names:
            raise InputError(
                f"{self.out}: no facade {id}{f' in run {run}' if run else ''}; search() lists those there are"
            )
        if len(names) > 1:
            raise InputError(f"{self.out}: facade {id} is in the runs {', '.join(names)}; name one with run=")
        return next(found.folder for found in find_runs(self.out)[0] if found.name == names[0])


def _read_facade(snapshot: SnapshotFolder[Folder], id: str) -> xr.Dataset:
    import xarray as xr
    import zarr

    store = snapshot.open_session().store
    group = cast(StoreGroup, zarr.open_group(store, mode="r"))
    facades = xr.open_zarr(store, group="facades", consolidated=False, chunks=None).load()
    index = list(map(str, facades.id.values)).index(id)
    charts = xr.open_zarr(store, group="charts", consolidated=False, chunks=None)
    chart = charts.isel(chart=int(facades.chart.values[index])).load()
    y, x, height, width = (int(chart[name]) for name in ("y", "x", "height", "width"))
    place = int(chart.page), slice(y, y + height), slice(x, x + width)
    whole = get_subgroup(group, "atlas").attrs["texels_per_metre"]
    density = float(chart.texels_per_metre if "texels_per_metre" in chart else whole)
    variables: dict[str, tuple[tuple[str, ...], AnyArray, dict[str, object]]] = {}
    for name, path in RASTERS.items():
        array = group[path]
        dimensions = ("y", "x", "band") if array.ndim == 4 else ("y", "x")
        variables[name] = (dimensions, np.asarray(array[place]), {"long_name": array.attrs["long_name"]})
    record = json.loads(group["journal/facades"][index].item() or "{}")
    return xr.Dataset(
        variables,
        coords={
            "y": ("y", (np.arange(height) + 0.5) / density, {"units": "m", "long_name": "down from the top"}),
            "x": ("x", (np.arange(width) + 0.5) / density, {"units": "m", "long_name": "along the wall"}),
        },
        attrs={
            "id": id,
            "crs": get_subgroup(group, "atlas").attrs["crs"],
            "origin": chart.origin.values.tolist(),
            "axis_x": chart.axis_u.values.tolist(),
            "axis_y": chart.axis_v.values.tolist(),
            "elements": json.dumps(record.get("elements", [])),
        },
    )


def open(out: Folder | str) -> Catalogue:
    """Open the catalogue of a run's folder, or of a folder of runs, which may be s3://bucket/prefix.

    Raises
    ------
    InputError : nothing is published there.
    """
    folder = folder_at(out)
    find_runs(folder)
    return Catalogue(folder)
