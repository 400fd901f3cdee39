"""Import of corrections that people made."""

from tasks.corrections.correction_import import (
    CorrectionImporter,
    ImportResult,
    find_run_block_file,
    import_corrections,
)

__all__ = ["CorrectionImporter", "ImportResult", "find_run_block_file", "import_corrections"]
