"""Errors, each one line with the file or unit and the remedy."""

from facade_core.core.errors import (
    BlockFileError,
    FacadeError,
    GeometryError,
    ImageError,
    InputError,
    LayoutError,
    LostStoreError,
    MachineError,
    ModelFileError,
    StoreError,
    StoreFormatError,
    TooManyFailuresError,
)

__all__ = [
    "BlockFileError",
    "FacadeError",
    "GeometryError",
    "ImageError",
    "InputError",
    "LayoutError",
    "LostStoreError",
    "MachineError",
    "ModelFileError",
    "StoreError",
    "StoreFormatError",
    "TooManyFailuresError",
]
