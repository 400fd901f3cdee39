"""What is said before a command begins: a Python without checks, kernels to compile, blocks that should be cities."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from flows.cli.exit_codes import EXIT_UNUSABLE
from flows.cli.output import print_notice

if TYPE_CHECKING:
    from catalogs.block.reader import Block

# Facades of a block, above which `run` points to `city`: some ten blocks of 400 m in a dense town.
MAX_BLOCK_FACADES = 2500


def refuse_python_without_checks() -> None:
    """End the process if Python leaves out assertions: a healthy store may then look broken."""
    if sys.flags.optimize:
        print_notice("Python's -O and PYTHONOPTIMIZE leave out checks; run it without them")
        sys.exit(EXIT_UNUSABLE)


def refuse_closed_streams() -> None:
    """End the process if standard output or error is closed: the next file that is opened would take its place."""
    if sys.stdout is None or sys.stderr is None:
        if sys.stderr is not None:
            print_notice("standard output is closed; send it to a file, or to /dev/null")
        os._exit(EXIT_UNUSABLE)


def note_first_run() -> None:
    """Print a notice where the kernels of the present code are still to be compiled on this machine."""
    from tasks.engine.kernel_compilation import has_compiled_kernels

    if not has_compiled_kernels():
        print_notice("compiling kernels, first run only: about a minute")


def note_large_block(block: Block, block_file: Path, workers: int) -> None:
    """Print a notice where a block is so large that `city` suits it better; blocks of a city are left out."""
    from catalogs.printable_text import format_command
    from flows.console import format_duration
    from tasks.city.block_counts import block_counts_from_map
    from tasks.city.cost import load_cost_model

    if block.part is not None:
        return
    model = load_cost_model()
    estimate = model.estimate([model.correct_map_counts(block_counts_from_map(block))], workers)
    if estimate["facades"] > MAX_BLOCK_FACADES:
        print_notice(
            f"about {estimate['facades']:,} facades, {format_duration(3600 * estimate['hours'])} with {workers} workers; "
            f"above {MAX_BLOCK_FACADES:,} facades use `{format_command('city', block_file)}`, which publishes block by block"
        )
