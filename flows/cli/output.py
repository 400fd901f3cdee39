"""Output of commands, escaped so that no text from data can control the terminal."""

from __future__ import annotations

import click


def print_line(line: object, *, err: bool = False) -> None:
    """Print one line."""
    text = str(line)
    if not text.isprintable():
        from catalogs.printable_text import escape_invisible  # takes half a second

        text = escape_invisible(text)
    click.echo(text, err=err)


def print_command(label: str, *words: object) -> None:
    """Print a command of Streetloom to run next, quoted for a shell."""
    from catalogs.printable_text import format_command

    print_line(f"{label}: {format_command(*words)}")


def print_notice(line: str) -> None:
    """Print a notice on stderr, apart from the command's output."""
    print_line(f"streetloom: {line}", err=True)
