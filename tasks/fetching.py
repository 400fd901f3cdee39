"""Fetch the panoramas of a block: what a service has there, the fewest that show all facades, and where they were taken."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from catalogs.block.keys import check_keys
from catalogs.block.paths import resolve_paths
from catalogs.block.reader import Block, read_block
from catalogs.block.yaml_edits import add_imagery, format_imagery_entry
from catalogs.block.yaml_files import read_yaml
from catalogs.crs import bounds_to_lonlat
from catalogs.features import Fault
from catalogs.imagery.fetch_log import FetchLog, is_fetched, read_fetch_log
from catalogs.imagery.fetching import fetch_panoramas
from catalogs.imagery.remote_panorama import ImageryQuery, LonLatBox, RemotePanorama
from catalogs.imagery.services import ImageryService
from catalogs.readers.pictures.decoding import read_picture
from catalogs.readers.pictures.panoramas import project_pose
from facade_core.core.errors import ImageError, InputError
from facade_core.core.types import Pose
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.imagery.rectify.fisheye import is_fisheye
from facade_core.plan.ingest import place_poses
from facade_core.plan.panorama_choice import PanoramaChoice, choose_panoramas
from tasks.engine.progress import begin_stage, report_progress
from tasks.stages.ingest.planning import make_plan

# Rows and columns of a picture of which a service tells none.
DEFAULT_PANORAMA_SIZE = (2048, 4096)
# Beside a block file without panoramas.
FOLDER = "panoramas"
_FULL_PANORAMA = (0.0, 0.0, 1.0, 1.0)
# Longest side at which a picture is looked at for what lens it is of.
_LENS_CHECK_SIDE = 512


@dataclass(frozen=True)
class ImageryFetch:
    """What was fetched.

    Args:
        service: its name.
        account: all that is in the folder.
        offered: panoramas that the service has there.
        chosen: of these, those that were to be fetched.
        earlier: of those, how many were there already.
        choice: how they were chosen; None without a block.
        faults: pictures that cannot be used.
        refused: how many of the chosen are there and cannot be used.
        missing: how many of the chosen another run may still bring.
        named: what is to be written into the block file by hand; None where it names the folder.
    """

    service: str
    log: FetchLog
    offered: int
    chosen: int
    earlier: int
    choice: PanoramaChoice | None
    faults: tuple[Fault, ...]
    refused: int
    missing: int
    manual_entry: str | None = None

    def lines(self) -> list[str]:
        """What was done, one fact a line."""
        there = [one for one in self.log.pictures.values() if not one.refused]
        licences = sorted({one.licence or "not stated" for one in there})
        days = sorted(one.captured for one in there if one.captured)
        choice = self.choice
        return [
            f"offered    {self.offered} panoramas by {self.service}"
            + (
                f", {self.offered - choice.covering_panoramas} of which show no facade, or less than half as well"
                if choice
                else ""
            ),
            *(
                [
                    f"chosen     {self.chosen}, which show {choice.reached:.0f} of the {choice.shown:.0f} m2 of facades that "
                    f"any shows, on {choice.facades_shown} of {choice.facades} facades at streets"
                ]
                if choice
                else []
            ),
            f"fetched    {self.chosen - self.earlier - self.missing}, {self.earlier} were there"
            + (f"; of all of them {self.refused} cannot be used" if self.refused else ""),
            f"pictures   {len(there)}, {sum(one.bytes for one in there) / 1e6:.1f} MB, in {self.log.folder}",
            f"licences   {', '.join(licences) if there else '-'}",
            *([f"taken      {days[0]} to {days[-1]}"] if days else []),
        ]


def fetch_for_block(
    block_file: Path,
    service: ImageryService,
    *,
    to: Path | None = None,
    dates: str | None = None,
    max_count: int | None = None,
    licence: str | None = None,
) -> ImageryFetch:
    """Fetch the panoramas that a block's facades need, into the folder that its file names for them; where it names none, into
    `to` (beside it, `panoramas/`), which it names then.

    dates: from when to when they were taken, as STAC writes it. most: no more are fetched, those first that show the most.
    licence: of pictures that state none. Raises InputError, one line with the remedy, where nothing can be fetched.
    """
    named = _named_folder(block_file)
    folder = to or named or block_file.parent / FOLDER
    if named is not None and not (folder.resolve() == named.resolve() and is_fetched(named)):
        raise InputError(
            f"{block_file}: imagery.panoramas names {named}, and a block has one folder; take that out of the block file, "
            f"fetch, then: streetloom fetch-imagery {block_file} --from {named}"
        )
    account = read_fetch_log(folder)
    block = read_block(block_file)
    begin_stage("search", 1)
    offers, faults = _search(service, ImageryQuery(_search_box(block), dates, licence, block.crs.to_string()))
    report_progress("search", 1)
    choice = _choose_panoramas(block, offers)
    chosen = [offers[i] for i in choice.chosen[:max_count]]
    fetched = _download(service, account, offers, chosen, faults, choice)
    if named is not None or not any(not one.refused for one in account.pictures.values()):
        return fetched
    folder_name = Path(os.path.relpath(folder.resolve(), block_file.parent.resolve())).as_posix()
    poses = f"{folder_name}/{account.write_poses().name}"
    values = {"path": folder_name, "poses": poses}
    if add_imagery(block_file, "panoramas", values):
        return fetched
    return replace(fetched, named=f"imagery: {{{format_imagery_entry('panoramas', values)}}}")


def fetch_for_box(
    box: LonLatBox,
    to: Path,
    service: ImageryService,
    *,
    dates: str | None = None,
    max_count: int | None = None,
    licence: str | None = None,
) -> ImageryFetch:
    """Fetch all panoramas inside a box in degrees into a folder; no more than `most`, the newest first. As fetch_for_block."""
    wanted = ImageryQuery(box, dates, licence)
    account = read_fetch_log(to)
    begin_stage("search", 1)
    offers, faults = _search(service, wanted)
    report_progress("search", 1)
    return _download(service, account, offers, offers[:max_count], faults, None)


def _named_folder(block_file: Path) -> Path | None:
    """The folder of panoramas that a block file names, whether or not its pictures can be used."""
    try:
        keys = check_keys(read_yaml(block_file))
        if keys.imagery.panoramas is None:
            return None
        return resolve_paths(keys, block_file)["imagery.panoramas.path"][0]
    except ValueError as error:
        raise InputError(f"{block_file}: {error}") from error


def _search_box(block: Block) -> LonLatBox:
    """Where pictures that show the block are taken: around its buildings as far as a viewpoint sees."""
    bounds = np.array([building.footprint.bounds for building in block.buildings])
    reach = block.texture.visibility_range
    west, south = bounds[:, :2].min(axis=0) - reach
    east, north = bounds[:, 2:].max(axis=0) + reach
    return bounds_to_lonlat(block.crs.to_wkt(), (float(west), float(south), float(east), float(north)))


def _search(service: ImageryService, wanted: ImageryQuery) -> tuple[list[RemotePanorama], tuple[Fault, ...]]:
    """What a service has, the newest first, each once; and what of it cannot be used."""
    offers: dict[str, RemotePanorama] = {}
    faults = []
    for one in service.search(wanted):
        if isinstance(one, Fault):
            faults.append(one)
        else:
            offers.setdefault(one.id, one)
    by_id = sorted(offers.values(), key=lambda offer: offer.id)
    return sorted(by_id, key=lambda offer: offer.captured or "", reverse=True), tuple(faults)


def _choose_panoramas(block: Block, offers: Sequence[RemotePanorama]) -> PanoramaChoice:
    frames: dict = {}
    poses = [project_pose(offer.pose, _FULL_PANORAMA, block.crs, frames) for offer in offers]
    plan = make_plan(replace(block, panoramas=(), texture=replace(block.texture, panorama_width=256)))
    terrain = build_terrain(block.buildings, block.terrain)
    there: tuple[Pose, ...] = place_poses(poses, terrain, block.texture.viewpoint_height)
    return choose_panoramas(plan.scene, plan.facades, there, [offer.size or DEFAULT_PANORAMA_SIZE for offer in offers])


def _download(
    service: ImageryService,
    account: FetchLog,
    offers: Sequence[RemotePanorama],
    chosen: Sequence[RemotePanorama],
    faults: tuple[Fault, ...],
    choice: PanoramaChoice | None,
) -> ImageryFetch:
    earlier = sum(account.find_picture(service.name, offer.id) is not None for offer in chosen)
    begin_stage("fetch", len(chosen))

    def arrived(usable: bool) -> None:
        report_progress("fetch", 1, 0 if usable else 1)

    try:
        broken = fetch_panoramas(service.name, chosen, account, service.download, _check_not_fisheye, arrived)
    finally:
        account.write_poses()
    held = [account.find_picture(service.name, offer.id) for offer in chosen]
    return ImageryFetch(
        service.name,
        account,
        len(offers),
        len(chosen),
        earlier,
        choice,
        (*faults, *broken),
        refused=sum(one is not None and one.refused is not None for one in held),
        missing=held.count(None),
    )


def _check_not_fisheye(path: Path) -> None:
    """Raise ImageError where a picture is none of a panorama's kind."""
    if is_fisheye(read_picture(path, max_side=_LENS_CHECK_SIDE).rgb):
        raise ImageError("is of a fisheye lens and said to be equirectangular; stitch it, or leave it out")
