"""Fetching what was chosen: several pictures at once, each looked at before it is kept, none twice."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path

from catalogs.features import Fault
from catalogs.file_digest import file_digest
from catalogs.imagery.fetch_log import ARRIVING, Account, Kept
from catalogs.imagery.http_client import Away, Refused
from catalogs.imagery.remote_panorama import Offer, fault
from catalogs.readers.pictures.folders import check_picture
from catalogs.readers.pictures.opening import open_picture
from catalogs.readers.pictures.panoramas import check_equirectangular
from facade_core.core.errors import ImageError, InputError

# At once from one service.
THREADS = 4
# So many pictures one after the other that could not be had, and the service is taken to be away.
LOST = 8
_SUFFIX = {"JPEG": ".jpg", "MPO": ".jpg", "PNG": ".png", "WEBP": ".webp", "TIFF": ".tif"}

# Writes an offer's bytes into a file; their sha256. Raises Refused, Away.
Get = Callable[[Offer, Path], str]
# Raises InputError where a whole equirectangular picture is none after all.
Look = Callable[[Path], None]


def fetch_offers(
    source: str, offers: Sequence[Offer], account: Account, get: Get, look: Look, arrived: Callable[[bool], None]
) -> list[Fault]:
    """Fetch pictures into an account's folder; those that are there, or were refused for what they are, are not asked for.

    arrived: told of each that is done, and whether it can be used. Returns a fault for each that cannot, in their order.
    Raises Away where the service does not answer any more.
    """
    stems = _stems(source, offers, account)
    arriving = account.folder / ARRIVING
    shutil.rmtree(arriving, ignore_errors=True)
    arriving.mkdir()
    lost: list[Away] = []

    def one(offer: Offer) -> Fault | None:
        if len(failed := lost[:]) >= LOST:  # a copy: another thread may clear it meanwhile
            raise failed[-1]
        found = account.holds(source, offer.id)
        problem = found.refused if found else None
        if found is None:
            try:
                problem = _fetched(source, offer, stems[offer.id], account, arriving / stems[offer.id], get, look)
                lost.clear()
            except Away as error:
                lost.append(error)
                problem = str(error)
            except (InputError, ValueError) as error:
                problem = str(error)
        arrived(problem is None)
        return None if problem is None else fault(offer.id, problem.removeprefix(f"{stems[offer.id]} "))

    pool = ThreadPoolExecutor(THREADS)
    try:
        tasks = [pool.submit(one, offer) for offer in offers]
        wait(tasks, return_when=FIRST_EXCEPTION)
        broken = [problem for task in tasks if (problem := task.result()) is not None]
        return [*broken, *_twins_dropped(source, offers, account)]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        shutil.rmtree(arriving, ignore_errors=True)


def _twins_dropped(source: str, offers: Sequence[Offer], account: Account) -> list[Fault]:
    """Drop the pictures of which the same bytes are there already: once all are, as threads come in any order."""
    asked = {(source, offer.id) for offer in offers}
    first = {one.sha256: one for key, one in account.kept.items() if key not in asked and not one.refused}
    faults = []
    for offer in offers:
        kept = account.holds(source, offer.id)
        if kept is None or kept.refused:
            continue
        twin = first.setdefault(kept.sha256, kept)
        if twin is not kept:
            reason = f"is the same picture as {twin.id}, which is used; nothing is to be done"
            account.add(replace(kept, file="", refused=reason))
            (account.folder / kept.file).unlink()
            faults.append(fault(offer.id, reason))
    return faults


def _stems(source: str, offers: Sequence[Offer], account: Account) -> dict[str, str]:
    """A name for each picture; of two whose ids are one name where letters' case does not count, the second has its digest."""
    stems: dict[str, str] = {}
    taken: set[str] = set()
    for offer in offers:
        stem = account.stem(source, offer)
        if stem.casefold() in taken:
            stem = f"{stem[:80]}-{hashlib.sha256(offer.id.encode(errors='surrogatepass')).hexdigest()[:8]}"
        taken.add(stem.casefold())
        stems[offer.id] = stem
    return stems


def _fetched(source: str, offer: Offer, stem: str, account: Account, part: Path, get: Get, look: Look) -> str | None:
    """Fetch one picture, or take what arrived before a kill could be accounted for; why it is refused for what it is, or None.

    Raises Refused, Away and InputError for what another run may find mended.
    """
    there = next((path for path in (account.folder / f"{stem}{s}" for s in _SUFFIX.values()) if path.is_file()), None)
    if there is not None:
        os.replace(there, part)
    try:
        digest = file_digest(part) if there is not None else get(offer, part)
        if offer.sha256 not in (None, digest):
            raise Refused("is not what its service says (checksum differs); run again, or tell its service")
        try:
            check_picture(part)
        except InputError as error:  # which names its folder too
            raise Refused(str(error).removeprefix(f"{part.parent}: ")) from error
        suffix, problem = _judged(part, look)
        pose = offer.pose
        name = "" if problem else f"{stem}{suffix}"
        size = part.stat().st_size
        if not problem:
            os.replace(part, account.folder / name)
        account.add(
            Kept(
                source=source,
                id=offer.id,
                file=name,
                sha256=digest,
                bytes=size,
                lon=pose.x,
                lat=pose.y,
                z=pose.z,
                heading=pose.heading or 0.0,
                pitch=pose.pitch,
                roll=pose.roll,
                captured=offer.captured,
                author=offer.author,
                licence=offer.licence,
                licence_url=offer.licence_url,
                refused=problem,
            )
        )
        return problem
    finally:
        part.unlink(missing_ok=True)


def _judged(part: Path, look: Look) -> tuple[str, str | None]:
    """The suffix of a picture's file, and why it is no panorama that can be used."""
    try:
        with open_picture(part) as image:
            kind = str(image.format)
        if kind not in _SUFFIX:
            raise ImageError(f"is a {kind}; ask for a JPEG")
        check_equirectangular(part)
        look(part)
    except (ImageError, ValueError) as error:
        return "", str(error)
    return _SUFFIX[kind], None
