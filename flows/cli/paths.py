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


# Kinds of the files and folders that arguments take, by metavar.
_BLOCK_FILE_KINDS = {"BLOCK.yaml": "block file", "CITY.yaml": "city file"}
_RESULT_METAVARS = ("OUT", "FOLDER")


def _reject_wrong_kind(value: str | os.PathLike[str], kind: PathType, param: click.Parameter | None) -> None:
    """Raise click.BadParameter for a folder where a file is expected, or a file where a folder is; it names the remedy."""
    path = Path(value)
    metavar = ((param.metavar if param else None) or "").strip("[]")
    if not kind.dir_okay and path.is_dir():
        if expected := _BLOCK_FILE_KINDS.get(metavar):
            own = path / f"{path.resolve().name}.yaml"
            found = own if own.is_file() else min(path.glob("*.yaml"), default=None)
            remedy = f"name a {expected}" + (f" such as {found}" if found else "")
        else:
            from catalogs.block.declared_keys import PathKind
            from catalogs.block.paths import folder_remedy

            remedy = folder_remedy(metavar, path, PathKind.FILE)
        raise click.BadParameter(f"{path} is a folder; {remedy}", param=param)
    if not kind.file_okay and path.is_file():
        is_result = metavar in _RESULT_METAVARS
        example = f"out/{path.stem}" if path.suffix in (".yaml", ".yml") else "out/demo"
        remedy = f"name a folder of results such as {example}" if is_result else "name a folder"
        raise click.BadParameter(f"{path} is a file; {remedy}", param=param)


class ExistingPath(PathType):
    """Existing file or folder; suggests similar names when the path does not exist."""

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Check that a path exists and is of the right kind; the error suggests a similar name."""
        _reject_wrong_kind(value, self, param)
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
        _reject_wrong_kind(value, self, param)
        return super().convert(value, param, ctx)


FOLDER = LocalOutputPath(file_okay=False, path_type=Path)
NEW_FILE = LocalOutputPath(dir_okay=False, path_type=Path)
OUT = LocalOrS3Folder()
EXISTING_OUT = LocalOrS3Folder(existing=True)
