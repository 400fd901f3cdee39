"""Checks of array archives before decompression: claimed against possible sizes."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Sequence
from pathlib import Path

from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.settings import LIMITS, MODELS
from facade_core.core.errors import InputError


def check_npz_arrays(path: Path, names: Sequence[str]) -> None:
    """Raise InputError unless the named arrays of an .npz have the claimed sizes.

    Together they must not exceed MODELS.max_npz_bytes. Only the headers are decompressed.

    Parameters
    ----------
    path : .npz file.
    names : arrays to check.
    """
    from numpy.lib import format as npy

    read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
    total = 0
    with (
        wrap_reader_errors(path, "cannot be read as arrays of triangles", "save it with np.savez"),
        zipfile.ZipFile(path) as archive,
    ):
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        for info in (members[name] for name in names if name in members):
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise InputError(f"{path} is packed by another method than np.savez_compressed; save it with that")
            total += info.file_size
            if info.file_size > max(MODELS.min_unpack_limit_bytes, LIMITS.max_unpack_ratio * info.compress_size):
                raise InputError(
                    f"{path}: {info.filename} unpacks to over {LIMITS.max_unpack_ratio} times its size; save it again"
                )
            if total > MODELS.max_npz_bytes:
                raise InputError(
                    f"{path} unpacks to over {MODELS.max_npz_bytes // 2**20} MB; "
                    "cut out the block that is meant, or use float32"
                )
            with archive.open(info) as member:
                shape, _, kind = read.get(npy.read_magic(member), npy.read_array_header_1_0)(member)
            if math.prod(shape) * kind.itemsize > info.file_size:
                raise InputError(
                    f"{path}: {info.filename} claims the shape {shape}, and is not as large; save it again"
                )
