"""Taking back what people corrected."""

from tasks.corrections.correction_import import Imported, Taker, block_of, import_corrections

__all__ = ["Imported", "Taker", "block_of", "import_corrections"]
