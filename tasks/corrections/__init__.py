"""Taking back what people corrected."""

from tasks.corrections.taking import Imported, block_of, import_corrections, take_corrections

__all__ = ["Imported", "block_of", "import_corrections", "take_corrections"]
