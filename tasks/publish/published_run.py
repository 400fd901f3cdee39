"""What a run has published: the snapshot that `current` points at, opened, and nothing newer."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from catalogs.published.folders import Folder
from catalogs.published.runs import find_runs
from catalogs.published.snapshot import Snapshot, current_snapshot
from facade_core.core.arrays import IntArray, UInt8Array
from facade_core.core.errors import FormatError, InputError
from facade_core.core.types import Element
from tasks.publish.attribution import read_attribution
from tasks.publish.stored_block import StoredBlock, read_stored_block

if TYPE_CHECKING:
    from facade_core.export.attribution import Attribution
    from facade_core.export.models.textured_mesh import TexturedMesh


@dataclass(frozen=True)
class PublishedBlock(StoredBlock):
    """A block as a published snapshot holds it, and that snapshot's files."""

    snapshot: Snapshot

    @property
    def block(self) -> str:
        return str(self.group.attrs["block"])

    @property
    def crs(self) -> str:
        return str(self.group.attrs["crs"])

    @cached_property
    def textured(self) -> TexturedMesh:
        """The block with the pages that were published; of a part of a city what is its own."""
        from facade_core.export.models.textured_mesh import build_textured_mesh, filter_triangles

        found = build_textured_mesh(self.plan.scene, self.page)
        return replace(found, mesh=filter_triangles(found.mesh, self.plan.in_core[found.mesh.chart]))

    @cached_property
    def attribution(self) -> Attribution:
        """Whom to name for what is shown, and when it was made."""
        return read_attribution(self.snapshot.stac, self.snapshot.items, self.block)

    def page(self, page: int) -> UInt8Array:
        """A filled page of the atlas, (h, w, 3) uint8."""
        from PIL import Image

        path = self.snapshot.page(page)
        try:
            with Image.open(io.BytesIO(path.read_bytes())) as image:
                return np.asarray(image.convert("RGB"))
        except OSError as error:
            raise InputError(f"{path} cannot be read as a picture; {self.snapshot.remedy}") from error

    def select_buildings(self, ids: Sequence[str]) -> IntArray:
        """The buildings that are named, all that have surfaces where none is. Raises InputError for an unknown one."""
        built = np.unique(self.plan.scene.charts.building[self.plan.in_core])
        built = built[built >= 0]
        if not ids:
            return built
        known = {self.names[b]: b for b in built.tolist()}
        for name in ids:
            if name not in known:
                near = get_close_matches(name, known, n=1, cutoff=0.5)
                if (building := name.rpartition("-")[0]) in known:
                    raise InputError(f"--building {name}: that is a facade; --building {building} is its building")
                hint = f"did you mean {near[0]}?" if near else f"known are e.g. {', '.join(list(known)[:3])}"
                raise InputError(f"--building {name}: the block {self.block} has no such building; {hint}")
        return np.unique([known[name] for name in ids])

    def elements(self, facade: int) -> list[Element]:
        """The elements of a completed facade, in texels, y down."""
        record = self.records[facade]
        rows = record.get("elements", []) if record else []
        return [Element(row[0], *map(float, row[1:6])) for row in rows]

    def finished_facades(self, buildings: IntArray) -> list[int]:
        """The facades of some buildings that have a finished layout and texture."""
        is_chosen = np.isin(self.plan.facades.building, buildings).tolist()
        return [i for i, record in enumerate(self.records) if is_chosen[i] and record and "lattice" in record]


@contextmanager
def open_published_run(out: Folder) -> Iterator[PublishedBlock]:
    """What the run in folder `out`, or the one run in the folder of runs `out`, has published; it stays until the block ends.

    Raises InputError where nothing is, or several runs have, and StoreError where the store does not hold the snapshot.
    """
    runs, _ = find_runs(out)
    if len(runs) > 1:
        raise InputError(f"{out}: holds {len(runs)} runs; name one, such as {runs[0].folder}")
    with current_snapshot(runs[0].folder).hold_for_reading() as snapshot:
        yield open_published_snapshot(snapshot)


def open_published_snapshot(snapshot: Snapshot) -> PublishedBlock:
    """What a snapshot that is kept from being pruned holds. Raises as `published`."""
    import icechunk

    session = snapshot.open_session()
    try:
        stored = read_stored_block(session)
    except (FormatError, icechunk.IcechunkError, ValueError, KeyError, AttributeError, FileNotFoundError) as error:
        raise snapshot.store_error(error) from error
    missing = [page for page in range(stored.plan.scene.spec.pages) if not snapshot.page(page).is_file()]
    if missing:
        raise InputError(f"{snapshot.page(missing[0])} is missing; {snapshot.remedy}")
    return PublishedBlock(stored.group, stored.plan, stored.buildings, snapshot)
