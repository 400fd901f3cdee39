"""What can go wrong, as a tree. Every message names the file or unit and the remedy, in one line."""

from __future__ import annotations


class FacadeError(Exception):
    """Root of every error that Streetloom raises for its user."""


class InputError(FacadeError):
    """Input that cannot be used: a file, a block key, an image, a geometry."""


class ImageError(InputError):
    """An image or mask of the wrong shape, type or content."""


class LayoutError(InputError):
    """Elements, domains or lattices that contradict each other."""


class GeometryError(InputError):
    """A mesh, footprint, street or chart that cannot be used."""


class BlockFileError(InputError):
    """A block file with an unknown key, a missing file or a wrong value."""


class ModelError(FacadeError):
    """A model file that is missing, has the wrong checksum or does not fit."""


class StoreError(FacadeError):
    """A store that cannot be opened, or whose content does not fit the block."""


class FormatError(StoreError):
    """A store whose tables, arrays or records another version wrote in another way."""


class WithheldError(FacadeError):
    """So many units failed that what was published is not made current."""


class MachineError(FacadeError):
    """The machine's fault, not the input's: a full disk, no memory, a store that fails. The unit that met it may be sound."""


class LostStoreError(StoreError, MachineError):
    """A store of which nothing can be read any more, by no fault of whoever runs the block."""
