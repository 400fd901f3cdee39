"""Public import path of the errors."""

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
