"""Import of corrections that people made."""

from tasks.corrections.correction_import import ImportResult, CorrectionImporter, find_block_file, import_corrections

__all__ = ["ImportResult", "CorrectionImporter", "find_block_file", "import_corrections"]
