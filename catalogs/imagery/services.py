"""Sources of pictures by name: a known service, a STAC API's address, or a folder."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

from catalogs.crs import LONLAT
from catalogs.features import Fault
from catalogs.file_digest import file_digest
from catalogs.imagery.fetch_log import POSES_NAME, has_fetch_log, read_fetch_log
from catalogs.imagery.fetching import Downloader
from catalogs.imagery.http_client import HttpClient, RequestRejectedError, ServiceToken, redact_url
from catalogs.imagery.mapillary import MAPILLARY_API as MAPILLARY
from catalogs.imagery.mapillary import search_mapillary
from catalogs.imagery.remote_panorama import PanoramaQuery, RemotePanorama
from catalogs.imagery.stac import search_stac
from catalogs.readers.pictures.panoramas import project_pose, read_panoramas
from catalogs.readers.pictures.source_poses import SourcePose
from facade_core.core.errors import InputError

# Federated search over the instances of Panoramax.
PANORAMAX_API = "https://api.panoramax.xyz/api"
TOKEN_VARIABLE = "STREETLOOM_IMAGERY_TOKEN"
Search = Callable[[PanoramaQuery], Iterator[RemotePanorama | Fault]]


@dataclass(frozen=True)
class ImageryService:
    """Source of pictures.

    Attributes
    ----------
    name : as in logs and messages.
    search : yields panoramas of a query.
    download : writes a panorama into a file.
    """

    name: str
    search: Search
    download: Downloader


def resolve_service(source: str, poses: Path | None = None) -> ImageryService:
    """Return the service that a word names; its token is read from the environment.

    Parameters
    ----------
    poses : poses file of a folder's pictures.

    Raises
    ------
    InputError : the word names no known service or folder.
    """
    if source == "mapillary" or "://" in source or source == "panoramax":
        if poses is not None:
            raise InputError(f"--poses: {source} tells where its pictures were taken; leave it out")
        if source == "mapillary":
            return mapillary_service(MAPILLARY)
        return stac_service(PANORAMAX_API if source == "panoramax" else source)
    folder = Path(source)
    if not folder.is_dir():
        raise InputError(
            f"--from {source}: is no folder here; give one, panoramax, mapillary, or a STAC API's https://..."
        )
    return _folder_service(folder, poses)


def stac_service(api: str) -> ImageryService:
    """Return the service of a STAC API at an address."""
    return _web_service(api, "Bearer", search_stac)


def mapillary_service(api: str) -> ImageryService:
    """Return the service of Mapillary's Graph API at an address."""
    return _web_service(api, "OAuth", search_mapillary)


def _web_service(
    api: str, token_kind: str, search: Callable[[HttpClient, str, PanoramaQuery], Iterator[RemotePanorama | Fault]]
) -> ImageryService:
    web = HttpClient(_read_token(api, token_kind))
    return ImageryService(redact_url(api), partial(search, web, api), lambda offer, path: web.download(offer.url, path))


def _read_token(api: str, kind: str) -> ServiceToken | None:
    """Read the token for an API's host. Raises InputError if it would be sent unencrypted."""
    secret = os.environ.get(TOKEN_VARIABLE, "").strip()
    if not secret:
        return None
    parts = urlsplit(api)
    if parts.scheme != "https" and parts.hostname not in ("127.0.0.1", "localhost", "::1"):
        raise InputError(
            f"{redact_url(api)} is no https, and {TOKEN_VARIABLE} would be read by others on its way; name https://..."
        )
    if not secret.isprintable() or " " in secret:
        raise InputError(f"{TOKEN_VARIABLE} holds what no token has; set it again")
    return ServiceToken(parts.netloc.rpartition("@")[2].lower(), f"{kind} {secret}")


def _folder_service(folder: Path, poses: Path | None) -> ImageryService:
    def search(wanted: PanoramaQuery) -> Iterator[RemotePanorama | Fault]:
        from pyproj import CRS

        if wanted.dates is not None:
            raise InputError("--dates: folders are taken as they are; leave it out, or put what is to be used into one")
        frame, lonlat = CRS.from_user_input(wanted.frame), CRS.from_user_input(LONLAT)
        found = read_panoramas(folder, poses or _default_poses_file(folder), frame)
        yield from found.faults
        # author and licence of pictures that were fetched before
        pictures = read_fetch_log(folder).pictures.values() if has_fetch_log(folder) else ()
        fetched = {picture.file: picture for picture in pictures}
        west, south, east, north = wanted.box
        for picture in found.items:
            pose = picture.pose
            stated = SourcePose(frame.to_wkt(), pose.x, pose.y, pose.z, pose.heading, pose.pitch, pose.roll)
            place = project_pose(stated, pose.view, lonlat, {})
            if west <= place.x <= east and south <= place.y <= north:
                lonlat_pose = SourcePose(LONLAT, place.x, place.y, pose.z, place.heading, pose.pitch, pose.roll)
                before = fetched.get(picture.path.name)
                rights = (before.author, before.licence, before.licence_url) if before else (None, None, None)
                yield RemotePanorama(
                    picture.id,
                    str(picture.path),
                    lonlat_pose,
                    captured=picture.captured,
                    author=rights[0],
                    licence=rights[1] or wanted.licence,
                    licence_url=rights[2],
                )

    return ImageryService(str(folder.resolve()), search, _copy_picture)  # distinguishes folders of the same name


def _default_poses_file(folder: Path) -> Path | None:
    """Return the poses file in the folder of the pictures, if there is one."""
    return folder / POSES_NAME if (folder / POSES_NAME).is_file() else None


def _copy_picture(offer: RemotePanorama, path: Path) -> str:
    try:
        shutil.copyfile(offer.url, path)
    except OSError as error:
        raise RequestRejectedError(f"cannot be copied ({error.strerror}); check its permissions") from error
    return file_digest(path)
