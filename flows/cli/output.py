"""What commands print: one function, through which no text out of data steers the terminal."""

from __future__ import annotations

import click


def print_line(line: object, *, err: bool = False) -> None:
    """Print one line."""
    text = str(line)
    if not text.isprintable():
        from catalogs.printable_text import escape_invisible  # takes half a second

        text = escape_invisible(text)
    click.echo(text, err=err)


def print_notice(line: str) -> None:
    """Say something to the user beside what was asked for."""
    print_line(f"streetloom: {line}", err=True)
