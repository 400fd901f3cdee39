"""Read access to the current published snapshot of a run."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property

import numpy as np

from catalogs.published.folders import Folder
from catalogs.published.runs import find_runs
from catalogs.published.snapshot import SnapshotFolder, current_snapshot
from facade_core.core.arrays import IntArray, UInt8Array
from facade_core.core.errors import InputError, StoreFormatError
from facade_core.core.types import Element
from facade_core.export.attribution import Attribution
from facade_core.export.models.textured_mesh import TexturedMesh
from tasks.publish.attribution import read_attribution
from tasks.publish.stored_block import StoredBlock, read_stored_block
from tasks.stages.shared.chart_elements import is_finished_facade, stored_elements


@dataclass(frozen=True)
class PublishedBlock(StoredBlock):
    """Block as a published snapshot holds it, with the store and the published files."""

    snapshot: SnapshotFolder[Folder]

    @property
    def block(self) -> str:
        """Return the name of the block."""
        return str(self.group.attrs["block"])

    @property
    def crs(self) -> str:
        """Return the coordinate reference system of the block."""
        return str(self.group.attrs["crs"])

    @cached_property
    def textured_mesh(self) -> TexturedMesh:
        """Build the mesh of the block with its published pages; in a part of a city, of its core only."""
        from facade_core.export.models.textured_mesh import build_textured_mesh, filter_triangles

        found = build_textured_mesh(self.plan.scene, self.page)
        return replace(found, mesh=filter_triangles(found.mesh, self.plan.in_core[found.mesh.chart]))

    @cached_property
    def attribution(self) -> Attribution:
        """Read data sources, publication date and capture dates of the snapshot."""
        return read_attribution(self.snapshot.stac, self.snapshot.items, self.block)

    def page(self, page: int) -> UInt8Array:
        """Read a filled page of the atlas, (h, w, 3) uint8.

        Raises
        ------
        InputError : the file cannot be decoded.
        """
        from PIL import Image

        path = self.snapshot.page(page)
        try:
            with Image.open(io.BytesIO(path.read_bytes())) as image:
                return np.asarray(image.convert("RGB"))
        except OSError as error:
            raise InputError(f"{path} cannot be read as a picture; {self.snapshot.remedy}") from error

    def select_buildings(self, ids: Sequence[str]) -> IntArray:
        """Return the indices of the named buildings, or of all with surfaces if `ids` is empty.

        Raises
        ------
        InputError : an id is unknown.
        """
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
        """Return the elements of a completed facade, in texels, y down."""
        record = self.records[facade]
        return stored_elements(record) if record else []

    def select_finished_facades(self, buildings: IntArray) -> list[int]:
        """Return the facades of some buildings that have a completed layout and texture.

        Parameters
        ----------
        buildings : (n,) building indices.
        """
        is_chosen = np.isin(self.plan.facades.building, buildings).tolist()
        return [i for i, record in enumerate(self.records) if is_chosen[i] and is_finished_facade(record)]


@contextmanager
def open_published_run(out: Folder) -> Iterator[PublishedBlock]:
    """Open the current snapshot of a run, and keep it from being pruned until the context ends.

    Parameters
    ----------
    out : folder of a run, or of runs with one run in it.

    Raises
    ------
    InputError : nothing is published, or the folder holds several runs.
    StoreError : the store does not hold the snapshot.
    """
    runs, _ = find_runs(out)
    if len(runs) > 1:
        raise InputError(f"{out}: holds {len(runs)} runs; name one, such as {runs[0].folder}")
    with current_snapshot(runs[0].folder).hold_for_reading() as snapshot:
        yield open_published_snapshot(snapshot)


def open_published_snapshot(snapshot: SnapshotFolder[Folder]) -> PublishedBlock:
    """Open a snapshot that the caller keeps from being pruned.

    Raises
    ------
    InputError : a page of the atlas is missing.
    StoreError : the store does not hold the snapshot.
    """
    import icechunk

    session = snapshot.open_session()
    try:
        stored = read_stored_block(session)
    except (StoreFormatError, icechunk.IcechunkError, ValueError, KeyError, AttributeError, FileNotFoundError) as error:
        raise snapshot.store_error(error) from error
    missing = [page for page in range(stored.plan.scene.spec.pages) if not snapshot.page(page).is_file()]
    if missing:
        raise InputError(f"{snapshot.page(missing[0])} is missing; {snapshot.remedy}")
    return PublishedBlock(stored.group, stored.plan, stored.buildings, snapshot)
