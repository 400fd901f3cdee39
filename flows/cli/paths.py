"""Parameter types for paths."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from catalogs.published.folders import Folder

    PathType = click.Path[Path]
    FolderType = click.ParamType[Folder, str | os.PathLike[str]]
else:  # releases of click differ in what these classes take as arguments
    PathType, FolderType = click.Path, click.ParamType


class ExistingPath(PathType):
    """Existing file or folder; suggests similar names when the path does not exist."""

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Check that a path exists; the error suggests a similar name."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            from catalogs.block.paths import suggest_similar_file_name

            path = Path(value)
            if os.path.lexists(path) or (close := suggest_similar_file_name(path)) is None:
                raise
            message = f"{error.message.rstrip('.')}; did you mean {path.with_name(close)}?"
            raise click.BadParameter(message, ctx, param) from error


EXISTING = ExistingPath(exists=True, path_type=Path)
EXISTING_FILE = ExistingPath(exists=True, dir_okay=False, path_type=Path)
EXISTING_FOLDER = ExistingPath(exists=True, file_okay=False, path_type=Path)


class LocalOrS3Folder(FolderType):
    """Folder of this machine, or s3://bucket/prefix.

    Parameters
    ----------
    existing : require that a local folder exists; buckets are not checked.
    """

    name = "folder"

    def __init__(self, *, existing: bool = False) -> None:
        self._local = EXISTING_FOLDER if existing else FOLDER

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> Folder:
        """Convert text to a local path or a folder in a bucket."""
        from catalogs.published.s3 import S3_SCHEME, folder_at

        if str(value).lower().startswith(S3_SCHEME):
            return folder_at(str(value))
        return self._local.convert(value, param, ctx)


class LocalOutputPath(PathType):
    """File or folder to write; rejects addresses with a scheme, which would create a folder of that name."""

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Convert text to a local path; reject empty text and addresses with a scheme."""
        from facade_core.core.errors import InputError

        name = param.opts[0] if isinstance(param, click.Option) else param.human_readable_name if param else "path"
        if not str(value).strip():  # an unset variable of a script
            raise InputError(f"{name}: is empty; name a folder or file")
        if "://" in str(value):
            raise InputError(f"{name} {value}: is written to folders of this machine only; name one")
        return super().convert(value, param, ctx)


FOLDER = LocalOutputPath(file_okay=False, path_type=Path)
NEW_FILE = LocalOutputPath(dir_okay=False, path_type=Path)
OUT = LocalOrS3Folder()
EXISTING_OUT = LocalOrS3Folder(existing=True)
