"""Commands with a box of longitudes and latitudes."""

from __future__ import annotations

from typing import Any

import click


class WithBox(click.Command):
    """A command whose --bbox says in one line what it wants."""

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        from facade_core.errors import InputError

        try:
            return super().make_context(*args, **kwargs)
        except click.UsageError as error:
            if "--bbox" not in error.format_message():
                raise
            raise InputError(
                "--bbox: give four numbers, WEST SOUTH EAST NORTH in degrees, such as --bbox 24.94 60.16 24.95 60.17"
            ) from error
