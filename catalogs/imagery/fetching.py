"""Concurrent download of panoramas; each is checked, and none is downloaded twice."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path

from catalogs.features import Fault
from catalogs.file_digest import file_digest
from catalogs.imagery.fetch_log import PARTIAL_FOLDER, FetchedPicture, FetchLog
from catalogs.imagery.http_client import RequestRejectedError, ServiceUnavailableError
from catalogs.imagery.remote_panorama import RemotePanorama, panorama_fault
from catalogs.imagery.settings import SERVICES
from catalogs.readers.pictures.decoding import open_picture
from catalogs.readers.pictures.embedded_poses import check_equirectangular
from catalogs.readers.pictures.folders import check_picture
from facade_core.core.errors import ImageError, InputError

_SUFFIX_BY_FORMAT = {"JPEG": ".jpg", "MPO": ".jpg", "PNG": ".png", "WEBP": ".webp", "TIFF": ".tif"}

# Writes a panorama's bytes into a file and returns their sha256. Raises RequestRejected, ServiceUnavailable.
Downloader = Callable[[RemotePanorama, Path], str]
# Raises InputError if a complete picture is no panorama.
PictureCheck = Callable[[Path], None]


def fetch_panoramas(
    source: str,
    panoramas: Sequence[RemotePanorama],
    fetch_log: FetchLog,
    download: Downloader,
    check: PictureCheck,
    on_fetched: Callable[[bool], None],
) -> list[Fault]:
    """Download panoramas into the folder of a fetch log; those present or rejected before are skipped.

    Parameters
    ----------
    source : name of the service, as logged.
    download : writes a panorama's bytes into a file and returns their sha256.
    check : raises InputError if a complete picture is no panorama.
    on_fetched : called for each panorama with whether it can be used.

    Returns
    -------
    Faults of the panoramas that cannot be used, in the given order.

    Raises
    ------
    ServiceUnavailable : the service stopped answering.
    """
    stems = _file_stems(source, panoramas, fetch_log)
    arriving = fetch_log.folder / PARTIAL_FOLDER
    shutil.rmtree(arriving, ignore_errors=True)
    arriving.mkdir()
    fetcher = _PanoramaFetcher(source, fetch_log, download, check)
    lost: list[ServiceUnavailableError] = []

    def fetch_one(offer: RemotePanorama) -> Fault | None:
        if len(failed := lost[:]) >= SERVICES.max_consecutive_failures:  # a copy: another thread may clear it meanwhile
            raise failed[-1]
        found = fetch_log.find_picture(source, offer.id)
        problem = found.refused if found else None
        if found is None:
            try:
                problem = fetcher.fetch(offer, stems[offer.id], arriving / stems[offer.id])
                lost.clear()
            except ServiceUnavailableError as error:
                lost.append(error)
                problem = str(error)
            except (InputError, ValueError) as error:
                problem = str(error)
        on_fetched(problem is None)
        return None if problem is None else panorama_fault(offer.id, problem.removeprefix(f"{stems[offer.id]} "))

    pool = ThreadPoolExecutor(SERVICES.max_downloads)
    try:
        tasks = [pool.submit(fetch_one, offer) for offer in panoramas]
        wait(tasks, return_when=FIRST_EXCEPTION)
        broken = [problem for task in tasks if (problem := task.result()) is not None]
        return [*broken, *_drop_duplicates(source, panoramas, fetch_log)]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        shutil.rmtree(arriving, ignore_errors=True)


def _drop_duplicates(source: str, panoramas: Sequence[RemotePanorama], fetch_log: FetchLog) -> list[Fault]:
    """Drop pictures whose bytes are present under another id.

    Runs last, since threads finish in any order.
    """
    asked = {(source, offer.id) for offer in panoramas}
    first = {one.sha256: one for key, one in fetch_log.pictures.items() if key not in asked and not one.refused}
    faults = []
    for offer in panoramas:
        kept = fetch_log.find_picture(source, offer.id)
        if kept is None or kept.refused:
            continue
        twin = first.setdefault(kept.sha256, kept)
        if twin is not kept:
            reason = f"is the same picture as {twin.id}, which is used; nothing is to be done"
            fetch_log.append(replace(kept, file="", refused=reason))
            (fetch_log.folder / kept.file).unlink()
            faults.append(panorama_fault(offer.id, reason))
    return faults


def _file_stems(source: str, panoramas: Sequence[RemotePanorama], fetch_log: FetchLog) -> dict[str, str]:
    """Return a file stem for each panorama; stems that differ only in case get a digest."""
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for offer in panoramas:
        stem = fetch_log.choose_stem(source, offer)
        if stem.casefold() in taken:
            stem = f"{stem[:80]}-{hashlib.sha256(offer.id.encode(errors='surrogatepass')).hexdigest()[:8]}"
        taken.add(stem.casefold())
        stems[offer.id] = stem
    return stems


@dataclass(frozen=True)
class _PanoramaFetcher:
    """Download of panoramas of one service into the folder of a fetch log.

    Attributes
    ----------
    source : name of the service, as logged.
    download : writes a panorama's bytes into a file and returns their sha256.
    check : raises InputError if a complete picture is no panorama.
    """

    source: str
    fetch_log: FetchLog
    download: Downloader
    check: PictureCheck

    def fetch(self, panorama: RemotePanorama, stem: str, part: Path) -> str | None:
        """Download one panorama, or adopt a file whose log line was lost.

        Returns why it is rejected, or None. Raises RequestRejected, ServiceUnavailable and InputError for problems that a
        later run may not have.
        """
        paths = (self.fetch_log.folder / f"{stem}{suffix}" for suffix in _SUFFIX_BY_FORMAT.values())
        there = next(filter(Path.is_file, paths), None)
        if there is not None:
            os.replace(there, part)
        try:
            digest = file_digest(part) if there is not None else self.download(panorama, part)
            if panorama.sha256 not in (None, digest):
                raise RequestRejectedError(
                    "is not what its service says (checksum differs); run again, or tell its service"
                )
            try:
                check_picture(part)
            except InputError as error:  # its message starts with the folder
                raise RequestRejectedError(str(error).removeprefix(f"{part.parent}: ")) from error
            suffix, problem = _check_format(part, self.check)
            pose = panorama.pose
            assert pose.x is not None
            assert pose.y is not None
            name = "" if problem else f"{stem}{suffix}"
            size = part.stat().st_size
            if not problem:
                os.replace(part, self.fetch_log.folder / name)
            self.fetch_log.append(
                FetchedPicture(
                    source=self.source,
                    id=panorama.id,
                    file=name,
                    sha256=digest,
                    bytes=size,
                    lon=pose.x,
                    lat=pose.y,
                    z=pose.z,
                    heading=pose.heading or 0.0,
                    pitch=pose.pitch or 0.0,
                    roll=pose.roll or 0.0,
                    captured=panorama.captured,
                    author=panorama.author,
                    licence=panorama.licence,
                    licence_url=panorama.licence_url,
                    refused=problem,
                )
            )
            return problem
        finally:
            part.unlink(missing_ok=True)


def _check_format(part: Path, check: PictureCheck) -> tuple[str, str | None]:
    """Return the suffix of a picture's file, and why it is no usable panorama."""
    try:
        with open_picture(part) as image:
            kind = str(image.format)
        if kind not in _SUFFIX_BY_FORMAT:
            raise ImageError(f"is a {kind}; ask for a JPEG")
        check_equirectangular(part)
        check(part)
    except (ImageError, ValueError) as error:
        return "", str(error)
    return _SUFFIX_BY_FORMAT[kind], None
