"""One-line messages for invalid command lines, with the command whose help explains more."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from typing import IO

import click

from flows.cli.output import print_notice

# Number types of Click, and their messages.
NUMBER_MESSAGES = {
    "integer range": "is no whole number",
    "float range": "is no number",
    "integer": "is no whole number",
    "float": "is no number",
}


class CommandLineError(click.ClickException):
    """Error of an invalid command line; Click's own errors print four lines."""

    exit_code = 2

    def show(self, file: IO[str] | None = None) -> None:
        """Print the message as one line on stderr."""
        print_notice(self.message)


@contextmanager
def single_line_errors(parent: click.Context | None = None) -> Iterator[None]:
    """Convert Click's usage errors to CommandLineError; a group without a command still shows its help.

    Parameters
    ----------
    parent : context of the group that invokes a command, which Click omits from some errors of the command's options.
    """
    try:
        yield
    except click.exceptions.NoArgsIsHelpError:
        raise
    except click.UsageError as error:
        raise CommandLineError(_usage_line(error, parent)) from error


def _usage_line(error: click.UsageError, parent: click.Context | None) -> str:
    """Format such as "run: no such option --worker; did you mean --workers? (streetloom run --help)"."""
    names: list[str] = []
    context = error.ctx
    if context is None and parent is not None and parent.invoked_subcommand:
        names = [parent.invoked_subcommand]
    while context is not None and context.parent is not None:
        names.insert(0, str(context.info_name))
        context = context.parent
    command = " ".join(names)
    message = " ".join(_error_text(error).split()).rstrip(".")
    remedy = f"(streetloom {command} --help)" if command else "(streetloom --help)"
    return f"{f'{command}: ' if command else ''}{message[:1].lower()}{message[1:]} {remedy}"


def _error_text(error: click.UsageError) -> str:
    if isinstance(error, click.NoSuchOption):
        return f"no such option {error.option_name}{_suggest_names(error.possibilities)}"
    if isinstance(error, click.exceptions.NoSuchCommand):
        return f"no such command {error.command_name}{_suggest_names(error.possibilities)}"
    message = error.format_message().rstrip(".") + _suggest_choice(error)
    for number_type, words in NUMBER_MESSAGES.items():
        message = message.replace(f"is not a valid {number_type}", words)
    if decimal := re.search(r"'([-+]?\d+),(\d+)' is no number", message):
        return f"{message}; write a decimal point: {decimal[1]}.{decimal[2]}"
    in_metres = isinstance(error, click.BadParameter) and error.param is not None and error.param.metavar == "METRES"
    return f"{message} metres" if in_metres and "is not in the range" in message else message


def _suggest_choice(error: click.UsageError) -> str:
    """Return a suggestion for an invalid value of a choice option."""
    chosen = error.param.type if isinstance(error, click.BadParameter) and error.param else None
    given = re.match(r"'(.*?)' is not one of", error.message)
    if not isinstance(chosen, click.Choice) or given is None:
        return ""
    close = get_close_matches(given[1], map(str, chosen.choices), n=1, cutoff=0.5)
    return f"; did you mean {close[0]}?" if close else ""


def _suggest_names(names: Iterable[str] | None) -> str:
    return f"; did you mean {' or '.join(names)}?" if names else ""


class BboxCommand(click.Command):
    """Command with a one-line error for an invalid --bbox."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: object
    ) -> click.Context:
        """Parse the command line; an invalid --bbox gives an error of one line."""
        from facade_core.core.errors import InputError

        try:
            return super().make_context(info_name, args, parent, **extra)
        except click.UsageError as error:
            if "--bbox" not in error.format_message():
                raise
            raise InputError(
                "--bbox: give four numbers, WEST SOUTH EAST NORTH in degrees, such as --bbox 24.94 60.16 24.95 60.17"
            ) from error


def current_user() -> str:
    """Return the login name.

    Raises
    ------
    InputError
        The machine has no name for the user, as in some containers.
    """
    import getpass

    from facade_core.core.errors import InputError

    try:
        return getpass.getuser()
    except (KeyError, OSError) as error:
        raise InputError("this machine has no name for you; say who you are with --who NAME") from error
