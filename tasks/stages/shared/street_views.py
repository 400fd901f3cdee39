"""What viewpoints of streets decided, as the store holds it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from facade_core.atlas.journal import read_journal, unit_key
from facade_core.atlas.stored_files import digest_stored_file, read_verified_array, street_view_path
from facade_core.core.zarr_types import COMPRESSORS, StoreGroup
from facade_core.geometry.raycast import MISS
from facade_core.geometry.streets import Viewpoint
from facade_core.plan.plan import Plan
from facade_core.street.continuation import StreetView


@dataclass(frozen=True)
class StoredView:
    """What a viewpoint decided, in the store.

    Attributes
    ----------
    path, digest : of its array.
    street, number : id of its street, and its number along it: views are blended in this order.
    position, forward : of the viewpoint.
    """

    path: str
    digest: str
    street: str
    number: int
    position: tuple[float, ...]
    forward: tuple[float, ...]

    @property
    def place(self) -> tuple[str, int]:
        """Return the place of the view in the order of all: it does not change with the numbers of viewpoints."""
        return self.street, self.number

    def digest_content(self) -> object:
        """Return what tells this view from others: one text, as a piece of ground may have many views."""
        return self._content

    @cached_property
    def _content(self) -> str:
        return unit_key(self.digest, self.position, self.forward)

    def read(self, group: StoreGroup, plan: Plan) -> StreetView:
        """Read the view for a plan of the block; its viewpoint has no id.

        Raises
        ------
        StoreError : it is missing, or not as it was written.
        """
        data = read_verified_array(group, self.path, self.digest)
        number = np.ascontiguousarray(data[..., 4:]).view(np.uint64)[..., 0]
        flat = number.reshape(-1)
        starts = np.flatnonzero(np.append(True, flat[1:] != flat[:-1]))
        shown, place = np.unique(flat[starts], return_inverse=True)
        order = np.argsort(plan.ids)
        row = order[np.searchsorted(plan.ids, shown, sorter=order) % len(order)]
        rows = np.where(plan.ids[row] == shown, row, MISS).astype(np.int32)
        charts = np.repeat(rows[place], np.diff(starts, append=len(flat)))
        viewpoint = Viewpoint(0, 0, np.array(self.position), np.array(self.forward))
        difference, kind = np.ascontiguousarray(data[..., :3]), np.ascontiguousarray(data[..., 3])
        return StreetView(viewpoint, difference, charts.reshape(number.shape), kind)


def write_street_view(group: StoreGroup, plan: Plan, path: str, view: StreetView) -> str:
    """Write what a viewpoint decided, as `StoredView.read` reads it; returns its digest."""
    ids = np.append(plan.ids, np.uint64(0))  # 0 for MISS, the last
    charts = np.ascontiguousarray(ids[view.chart]).view(np.uint8).reshape(*view.chart.shape, 8)
    data = np.concatenate([view.difference, view.kind[..., None], charts], axis=2)
    meaning = "difference of ground from its material, 128 for none, its kind, and the id of its chart"
    group.create_array(
        path,
        data=data,
        chunks=data.shape,
        compressors=COMPRESSORS,
        dimension_names=("row", "column", "band"),
        attributes={"long_name": meaning},
        overwrite=True,
    )
    return digest_stored_file(data.tobytes())


def list_stored_views(plan: Plan, group: StoreGroup) -> dict[int, StoredView]:
    """Return what the viewpoints of a block decided, by viewpoint; those that decided nothing are left out."""
    found = {}
    for street, record in enumerate(read_journal(group, "streets")):
        if record is None or not record.get("files"):
            continue
        for number, viewpoint in enumerate(plan.street_viewpoints(street)):
            path = street_view_path(record["unit"], number)
            if path in record["files"]:
                place = tuple(viewpoint.position.tolist()), tuple(viewpoint.forward.tolist())
                found[viewpoint.id] = StoredView(path, record["files"][path], record["unit"], number, *place)
    return found
