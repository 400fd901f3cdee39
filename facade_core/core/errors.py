"""Hierarchy of errors. Every message names the file or unit and the remedy, in one line."""

from __future__ import annotations


class FacadeError(Exception):
    """Base of every error that Streetloom raises for its user."""


class InputError(FacadeError):
    """Unusable input: a file, a block key, an image, a geometry."""


class ImageError(InputError):
    """Image or mask of the wrong shape, type or content."""


class HiddenFacadeError(ImageError):
    """Picture of a facade of which too little is seen."""


class LayoutError(InputError):
    """Contradictory elements, domains or lattices."""


class GeometryError(InputError):
    """Unusable mesh, footprint, street or chart."""


class BlockFileError(InputError):
    """Block file with an unknown key, a missing file or a wrong value."""


class ModelFileError(FacadeError):
    """File of a trained model that is missing, has the wrong checksum or does not fit."""


class StoreError(FacadeError):
    """Store that cannot be opened, or whose content does not fit the block."""


class StoreFormatError(StoreError):
    """Store whose tables, arrays or records are of another store format version."""


class TooManyFailuresError(FacadeError):
    """Too many units of a run failed, so its result is not made current."""


class MachineError(FacadeError):
    """Fault of the machine, not of the input: full disk, no memory, failing store. The unit itself may be sound."""


BUCKET_UNAVAILABLE = "its bucket does not answer; run again later: finished work is kept"


class BucketUnavailableError(MachineError):
    """Bucket that does not answer now. Committed units stay."""


class LostStoreError(StoreError, MachineError):
    """Store that can no longer be read, by no fault of the user."""
