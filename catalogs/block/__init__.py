"""Block file and everything that it names, read into one frozen value."""

from catalogs.block.reader import Block, TextureSettings, read_block

__all__ = ["Block", "TextureSettings", "read_block"]
