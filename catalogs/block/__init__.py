"""A block file and all that it names, as one frozen value."""

from catalogs.block.reader import Block, Material, TextureSettings, read_block

__all__ = ["Block", "Material", "TextureSettings", "read_block"]
