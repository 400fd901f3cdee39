"""Kinds of paths that commands take."""

from pathlib import Path
from typing import Any

import click

EXISTING_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
EXISTING_FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)


class LocalPath(click.Path):
    """A file or folder to write. What has a scheme would become a folder of that name, with the results in it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from facade_core.errors import InputError

        name = param.opts[0] if isinstance(param, click.Option) else param.human_readable_name if param else "path"
        if not str(value).strip():  # a variable of a script that is not set
            raise InputError(f"{name}: is empty; name a folder or file")
        if "://" in str(value):
            raise InputError(
                f"{name} {value}: results are written to folders of this machine only; name one, "
                "and copy it with `streetloom catalog FOLDER --to s3://...` afterwards"
            )
        return super().convert(value, param, ctx)


FOLDER = LocalPath(file_okay=False, path_type=Path)
NEW_FILE = LocalPath(dir_okay=False, path_type=Path)
