"""Public import path of the errors."""

from facade_core.core.errors import (
    BlockFileError,
    FacadeError,
    FormatError,
    GeometryError,
    ImageError,
    InputError,
    LayoutError,
    LostStoreError,
    MachineError,
    ModelError,
    StoreError,
    WithheldError,
)

__all__ = [
    "BlockFileError",
    "FacadeError",
    "FormatError",
    "GeometryError",
    "ImageError",
    "InputError",
    "LayoutError",
    "LostStoreError",
    "MachineError",
    "ModelError",
    "StoreError",
    "WithheldError",
]
