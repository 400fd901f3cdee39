"""Kinds of files in a folder of pictures: those that are read, their companions, and the reason for each other one."""

from __future__ import annotations

import importlib.util
import re
from functools import cache
from pathlib import Path

from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".tif", ".tiff", ".jpe", ".jfif", ".bmp", ".dib", ".gif")
HEIF_SUFFIXES = (".heic", ".heif", ".hif")
HEIF_REMEDY = "install pillow-heif (pip install 'streetloom[heif]'), or save it as JPEG"
LABEL_MAP_SUFFIX = ".labels.png"
# Files that accompany pictures: poses, logs, metadata, licences, georeferences.
COMPANION_SUFFIXES = frozenset(
    (
        ".json", ".jsonl", ".geojson", ".csv", ".tsv", ".txt", ".md", ".rst", ".log", ".yaml", ".yml", ".toml",
        ".xml", ".xmp", ".pp3", ".html", ".htm", ".ini", ".db", ".lnk", ".url", ".prj", ".wld", ".jgw", ".jpgw",
        ".pgw", ".pngw", ".tfw", ".tifw", ".ovr", ".sha256", ".md5", ".license",
    )
)  # fmt: skip
_COMPANION_NAMES = frozenset(("license", "licence", "copying", "readme", "authors", "notice"))
_START_BYTES = 16
_HEIF_BRANDS = frozenset((b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1"))
# First bytes of the formats that are read -> format and suffix.
_FORMATS = {
    re.compile(rb"\xff\xd8\xff"): ("JPEG", ".jpg"),
    re.compile(rb"\x89PNG"): ("PNG", ".png"),
    re.compile(rb"II\*\0|MM\0\*"): ("TIFF", ".tif"),
    re.compile(rb"GIF8"): ("GIF", ".gif"),
    re.compile(rb"BM"): ("BMP", ".bmp"),
    re.compile(rb"RIFF.{4}WEBP", re.DOTALL): ("WEBP", ".webp"),
}


# Files and folders that systems and servers leave beside others; names that begin with a point are hidden.
_SYSTEM_NAMES = frozenset((
    "__macosx", "thumbs.db", "ehthumbs.db", "desktop.ini", "@eadir", "#recycle", "$recycle.bin",
    "system volume information", "lost+found", "zbthumbnail.info", "icon\r",
))  # fmt: skip


def is_system_file(name: str) -> bool:
    """Return True for a file or folder that Finder, Windows or a NAS leaves beside others, or that is hidden."""
    return name.startswith((".", "~$")) or name.lower() in _SYSTEM_NAMES


@cache
def can_read_heif() -> bool:
    """Return True where the package that reads HEIC is installed."""
    return importlib.util.find_spec("pillow_heif") is not None


def is_picture_name(name: str) -> bool:
    """Return True for the name of a picture that is read, by its suffix; label maps and hidden files are none."""
    suffix = Path(name).suffix.lower()
    known = suffix in IMAGE_SUFFIXES or (suffix in HEIF_SUFFIXES and can_read_heif())
    return known and not is_system_file(name) and not name.endswith(LABEL_MAP_SUFFIX)


def is_heif(start: bytes) -> bool:
    """Return True where a file of these first bytes is HEIC."""
    return start[4:8] == b"ftyp" and start[8:12] in _HEIF_BRANDS


def unread_reason(path: Path) -> str | None:
    """Return the reason and the remedy for a file of a folder of pictures that is not read; None for its companions."""
    name, suffix = path.name, path.suffix.lower()
    if is_system_file(name) or name.endswith(LABEL_MAP_SUFFIX) or is_picture_name(name):
        return None
    if path.is_dir():
        return _unread_folder_reason(path)
    if suffix in HEIF_SUFFIXES:
        return f"{name} is HEIC, which is not read here; {HEIF_REMEDY}"
    if suffix in COMPANION_SUFFIXES or path.stem.lower() in _COMPANION_NAMES:
        return None
    return _unread_content_reason(path)


def _unread_content_reason(path: Path) -> str:
    """Return the reason why a file of an unknown suffix is not read, by its first bytes."""
    name, suffix, start = path.name, path.suffix.lower(), _first_bytes(path)
    if is_heif(start):
        return f"{name} is HEIC under another name; rename it to {path.stem}.heic, and {HEIF_REMEDY}"
    found = next((kind for magic, kind in _FORMATS.items() if magic.match(start)), None)
    if found is None or (found[0] == "TIFF" and suffix):  # raw files of cameras are TIFF too
        kind = f"of the kind {suffix}" if suffix else "without a suffix"
        return f"{name} is {kind}, which is not read; save it as JPEG or PNG, or remove it"
    return f"{name} is {found[0]} under another name; rename it to {path.stem or name}{found[1]}"


def _unread_folder_reason(path: Path) -> str | None:
    """Return the reason why the pictures of a folder in a folder are not read; None without pictures."""
    try:
        inside = any(is_picture_name(inner.name) for inner in path.iterdir())
    except OSError as error:
        return f"{path.name} is a folder that cannot be read ({error.strerror}); check its permissions, or remove it"
    return f"{path.name} is a folder, whose pictures are not read; move them up, or remove it" if inside else None


def _first_bytes(path: Path) -> bytes:
    """Return the first bytes of a file; none where it cannot be read."""
    try:
        with open_regular(path) as file:
            return file.read(_START_BYTES)
    except (OSError, InputError):
        return b""
