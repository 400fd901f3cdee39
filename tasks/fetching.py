"""Download of a block's panoramas from an imagery service: the fewest that show all facades."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pyproj import Transformer

from catalogs.block.key_faults import read_block_settings
from catalogs.block.paths import resolve_paths
from catalogs.block.reader import Block, read_block
from catalogs.block.settings import replace_settings
from catalogs.block.yaml_edits import add_imagery_entry, format_imagery_entry
from catalogs.crs import bounds_to_lonlat
from catalogs.features import Fault
from catalogs.imagery.fetch_log import FetchLog, has_fetch_log, read_fetch_log
from catalogs.imagery.fetching import fetch_panoramas
from catalogs.imagery.remote_panorama import LonLatBox, PanoramaQuery, RemotePanorama
from catalogs.imagery.services import ImageryService
from catalogs.printable_text import format_command
from catalogs.readers.pictures.decoding import read_picture
from catalogs.readers.pictures.panoramas import project_pose
from facade_core.core.errors import ImageError, InputError
from facade_core.core.types import Pose
from facade_core.geometry.ground.terrain import build_terrain
from facade_core.imagery.rectify.fisheye import is_fisheye
from facade_core.plan.ingest import fill_pose_heights
from facade_core.plan.panorama_choice import PanoramaChoice, choose_panoramas
from tasks.engine.progress import begin_stage, report_progress
from tasks.stages.ingest.planning import make_plan

# Rows and columns of a picture if the service states none.
DEFAULT_PANORAMA_SIZE = (2048, 4096)
# Default folder of panoramas, in the block file's folder.
FOLDER = "panoramas"
_FULL_PANORAMA = (0.0, 0.0, 1.0, 1.0)
# Longest side of a picture for the lens check, pixels.
_LENS_CHECK_SIDE = 512


@dataclass(frozen=True)
class ImageryFetchResult:
    """Result of a download of panoramas.

    Attributes
    ----------
    service : name of the service.
    log : log of the folder.
    offered : panoramas of the service in the area.
    chosen : panoramas that were selected.
    earlier : selected panoramas that the folder had before.
    choice : selection by visibility; None without a block.
    faults : unusable pictures.
    refused : selected panoramas that are unusable.
    missing : selected panoramas that a later run may still download.
    manual_entry : entry to add to the block file by hand; None if it names the folder.
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
        """Format the result, one line for each fact."""
        usable = [one for one in self.log.pictures.values() if not one.refused]
        licences = sorted({one.licence or "not stated" for one in usable})
        days = sorted(one.captured for one in usable if one.captured)
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
            f"pictures   {len(usable)}, {sum(one.bytes for one in usable) / 1e6:.1f} MB, in {self.log.folder}",
            f"licences   {', '.join(licences) if usable else '-'}",
            *([f"taken      {days[0]} to {days[-1]}"] if days else []),
        ]


def fetch_block_panoramas(
    block_file: Path,
    service: ImageryService,
    *,
    to: Path | None = None,
    dates: str | None = None,
    max_count: int | None = None,
    licence: str | None = None,
) -> ImageryFetchResult:
    """Download the panoramas that a block's facades need, and name their folder in the block file.

    Parameters
    ----------
    block_file : block file.
    service : imagery service.
    to : target folder if the block file names none; None: `panoramas/` next to it.
    dates : interval of capture, as in STAC.
    max_count : maximum number of panoramas, those that show the most first; None: no limit.
    licence : licence of pictures that state none.

    Raises
    ------
    InputError : nothing can be downloaded; one line with the remedy.
    """
    named = _named_folder(block_file)
    folder = to or named or block_file.parent / FOLDER
    if named is not None and not (folder.resolve() == named.resolve() and has_fetch_log(named)):
        raise InputError(
            f"{block_file}: imagery.panoramas names {named}, and a block has one folder; take that out of the block file, "
            f"fetch, then: {format_command('fetch-imagery', block_file, '--from', named)}"
        )
    log = read_fetch_log(folder)
    block = read_block(block_file)
    begin_stage("search", 1)
    offers, faults = _search(service, PanoramaQuery(_search_box(block), dates, licence, block.crs.to_string()))
    report_progress("search", 1)
    choice = _choose_panoramas(block, offers)
    chosen = [offers[i] for i in choice.chosen[:max_count]]
    fetched = _download(service, log, offers, chosen, faults, choice)
    if named is not None or not any(not one.refused for one in log.pictures.values()):
        return fetched
    folder_name = Path(os.path.relpath(folder.resolve(), block_file.parent.resolve())).as_posix()
    poses = f"{folder_name}/{log.write_poses().name}"
    values = {"path": folder_name, "poses": poses}
    if add_imagery_entry(block_file, "panoramas", values):
        return fetched
    return replace(fetched, manual_entry=f"imagery: {{{format_imagery_entry('panoramas', values)}}}")


def fetch_box_panoramas(
    box: LonLatBox,
    to: Path,
    service: ImageryService,
    *,
    dates: str | None = None,
    max_count: int | None = None,
    licence: str | None = None,
) -> ImageryFetchResult:
    """Download the panoramas in a box, the newest first.

    Parameters
    ----------
    box : area in degrees.
    to : target folder.
    service : imagery service.
    dates : interval of capture, as in STAC.
    max_count : maximum number of panoramas; None: no limit.
    licence : licence of pictures that state none.
    """
    wanted = PanoramaQuery(box, dates, licence)
    log = read_fetch_log(to)
    begin_stage("search", 1)
    offers, faults = _search(service, wanted)
    report_progress("search", 1)
    return _download(service, log, offers, offers[:max_count], faults, None)


def _named_folder(block_file: Path) -> Path | None:
    """Return the folder of panoramas that a block file names, without reading its pictures."""
    try:
        keys = read_block_settings(block_file)
        if keys.imagery.panoramas is None:
            return None
        return resolve_paths(keys, block_file)["imagery.panoramas.path"][0]
    except ValueError as error:
        raise InputError(f"{block_file}: {error}") from error


def _search_box(block: Block) -> LonLatBox:
    """Compute the search area: the buildings' extent plus the visibility range."""
    bounds = np.array([building.footprint.bounds for building in block.buildings])
    reach = block.texture.visibility_range
    west, south = bounds[:, :2].min(axis=0) - reach
    east, north = bounds[:, 2:].max(axis=0) + reach
    return bounds_to_lonlat(block.crs.to_wkt(), (float(west), float(south), float(east), float(north)))


def _search(service: ImageryService, wanted: PanoramaQuery) -> tuple[list[RemotePanorama], tuple[Fault, ...]]:
    """Query a service: distinct panoramas, newest first, and faults."""
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
    frames: dict[str | None, Transformer] = {}
    poses = [project_pose(offer.pose, _FULL_PANORAMA, block.crs, frames) for offer in offers]
    plan = make_plan(replace(block, panoramas=(), settings=replace_settings(block.settings, panorama_width=256)))
    terrain = build_terrain(block.buildings, block.terrain)
    placed: tuple[Pose, ...] = fill_pose_heights(poses, terrain, block.texture.viewpoint_height)
    return choose_panoramas(plan.scene, plan.facades, placed, [offer.size or DEFAULT_PANORAMA_SIZE for offer in offers])


def _download(
    service: ImageryService,
    log: FetchLog,
    offers: Sequence[RemotePanorama],
    chosen: Sequence[RemotePanorama],
    faults: tuple[Fault, ...],
    choice: PanoramaChoice | None,
) -> ImageryFetchResult:
    earlier = sum(log.find_picture(service.name, offer.id) is not None for offer in chosen)
    begin_stage("fetch", len(chosen))

    def arrived(usable: bool) -> None:
        report_progress("fetch", 1, 0 if usable else 1)

    try:
        broken = fetch_panoramas(service.name, chosen, log, service.download, _check_not_fisheye, arrived)
    finally:
        log.write_poses()
    pictures = [log.find_picture(service.name, offer.id) for offer in chosen]
    return ImageryFetchResult(
        service.name,
        log,
        len(offers),
        len(chosen),
        earlier,
        choice,
        (*faults, *broken),
        refused=sum(picture is not None and picture.refused is not None for picture in pictures),
        missing=pictures.count(None),
    )


def _check_not_fisheye(path: Path) -> None:
    """Raise ImageError for a picture of a fisheye lens."""
    if is_fisheye(read_picture(path, max_side=_LENS_CHECK_SIDE).rgb):
        raise ImageError("is of a fisheye lens and said to be equirectangular; stitch it, or leave it out")
