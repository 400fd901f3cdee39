"""Commands that read the products of runs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.output import print_line, print_notice
from flows.cli.paths import EXISTING_FOLDER, EXISTING_OUT, FOLDER, LocalOutputPath
from flows.cli.usage import BboxCommand, current_user
from flows.cli.viewed import find_viewed_folder
from flows.viewer import VIEWER_HOST, VIEWER_PORT
from tasks.export.registry import FORMATS, Purpose, list_city_formats

if TYPE_CHECKING:
    from catalogs.published.folders import Folder

    TextType = click.ParamType[str, str]
else:  # releases of click differ in what this class takes as arguments
    TextType = click.ParamType

# Exported files to list; above this number only the folder is printed.
MAX_LISTED_FILES = 8


class RunsFolderParam(TextType):
    """Existing folder, or s3://bucket/prefix, as text."""

    name = "folder"

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text of an existing folder or of a bucket's address."""
        if value.lower().startswith("s3://"):
            return value
        return str(EXISTING_FOLDER.convert(value, param, ctx))


class QueryCommand(BboxCommand):
    """Command whose help ends with the columns of the published table."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the columns of the published table below the help."""
        from catalogs.published.columns import COLUMNS

        with formatter.section("Columns (docs/reference/columns.md says what each means)"):
            formatter.write_text(", ".join(["run", *(column.name for column in COLUMNS)]))


@click.command(cls=QueryCommand, short_help="Find facades by their properties.")
@click.argument("folder", metavar="FOLDER", type=RunsFolderParam())
@click.option(
    "--where",
    "conditions",
    metavar="SQL",
    multiple=True,
    help="Condition on the columns of items.parquet and on run; several are combined with AND.",
)
@click.option("--bbox", nargs=4, type=float, metavar="W S E N", help="Area in degrees of longitude and latitude.")
@click.option(
    "--since", metavar="WHEN", help="Only items newer than a date (2026-11-21), a time (UTC) or an age (36h, 7d)."
)
@click.option(
    "--format",
    "style",
    type=click.Choice(["table", "json", "geojson", "parquet"]),
    default="table",
    show_default=True,
    help="parquet is GeoParquet, to redirect into a file.",
)
def query(
    folder: str, conditions: tuple[str, ...], bbox: tuple[float, ...] | None, since: str | None, style: str
) -> None:
    """Find facades in the products of a run, or of all runs in a folder or a bucket.

    \b
    Examples:
      streetloom query out/demo --where "floors >= 5 and occluded > 0.1"
      streetloom query out --since 7d --where "status = 'failed' and run <> 'demo'"
      streetloom query out/demo --bbox 24.94 60.16 24.95 60.17 --format geojson
      streetloom query out --format parquet > facades.parquet
      streetloom query s3://bucket/runs --where "photo > 0.5"
    """
    from catalogs.query.execution import query as find
    from catalogs.query.formats import format_items, to_parquet_bytes
    from catalogs.query.where import combine_conditions
    from facade_core.core.errors import InputError

    if style == "parquet" and sys.stdout.isatty():
        raise InputError("--format parquet: is no text; send it to a file, such as > facades.parquet")
    where = combine_conditions(conditions)
    found = find(folder, where=where, bbox=bbox or None, since=since, on_left_out=print_notice)
    if style == "parquet":
        click.echo(to_parquet_bytes(found), nl=False)
    else:
        click.echo(format_items(found, style, where))


class ExportCommand(click.Command):
    """Command whose help lists the formats."""

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help, and what each format contains."""
        super().format_help_text(ctx, formatter)
        formatter.write_paragraph()
        with formatter.indentation():
            formatter.write_text(f"Formats of a city: {', '.join(list_city_formats())}.")
        with formatter.section("Formats"):
            formatter.write_dl(
                [
                    (name, entry.content + (f" (`{entry.setup}`)" if entry.setup else ""))
                    for name, entry in FORMATS.items()
                ]
            )


def _with_formats(option: str) -> str:
    """Return the beginning of an option's help, which lists the formats that accept it."""
    names = [name for name, entry in FORMATS.items() if option in {*entry.options, *entry.factored_options}]
    return f"With {' or '.join(names)}:"


@click.command(cls=ExportCommand, short_help="Export a run or a city: models, tables, annotations.")
@click.argument("folder", metavar="OUT", type=EXISTING_OUT)
@click.option(
    "--format",
    "style",
    required=True,
    type=click.Choice(list(FORMATS)),
    help="; ".join(
        f"{', '.join(name for name, entry in FORMATS.items() if entry.purpose == purpose)}: {purpose}"
        for purpose in Purpose
    )
    + ".",
)
@click.option(
    "--to",
    type=LocalOutputPath(path_type=Path),
    help="Folder, or FILE.gpkg.  [default: OUT/exports/FORMAT]",
)
@click.option("--building", "buildings", multiple=True, metavar="ID", help="Export only this building; repeatable.")
@click.option(
    "--textures",
    type=click.Choice(["jpeg", "webp", "ktx2", "factored"]),
    help=f"{_with_formats('textures')} factored stores each type of window, door ... once and sharp, on walls of a tiling "
    "material. With 3dtiles: ktx2 stays compressed in graphics memory (`make ktx2-setup`).  [default: jpeg]",
)
@click.option(
    "--max-texture-mb",
    type=click.FloatRange(min=1),
    metavar="MB",
    help=f"{_with_formats('max_texture_mb')} downscale textures until a view takes at most this graphics memory; inf: no "
    "limit.  [default: 300, ktx2 120]",
)
@click.option(
    "--lit/--no-lit",
    default=None,
    help=f"{_with_formats('lit')} materials for lighting, with baked shading removed.  [default: glb and usd, unless "
    "most textures are those of the source model]",
)
@click.option(
    "--night",
    is_flag=True,
    help="With --lit: emissive windows. glb and usd have variants day and night; this selects night by default.",
)
@click.option(
    "--crs",
    type=click.Choice(["native"]),
    help=f"{_with_formats('crs')} coordinates and heights of the block's own CRS, for maps in that CRS, in "
    "exports/3dtiles-native.  [default: on the earth]",
)
@click.option(
    "--relief",
    type=click.Choice(["off", "elements"]),
    help=f"{_with_formats('relief')} elements sets windows, doors and shops back into the walls and brings balconies out.  "
    "[default: texture.relief of the block]",
)
def export(
    folder: Folder,
    style: str,
    to: Path | None,
    buildings: tuple[str, ...],
    textures: str | None,
    max_texture_mb: float | None,
    lit: bool | None,
    night: bool,
    crs: str | None,
    relief: str | None,
) -> None:
    """Export the products of a run, or of all blocks of a city, for other programs.

    Replaces an earlier export in the same place unless it was edited.

    The block's CRS is metric; heights are metres, as the sources state them or above the ground assumed there.

    A city is exported one block after the other, in the memory of one. A killed export resumes, and one of which nothing
    changed is kept.

    \b
    Examples:
      streetloom export out/demo --format glb                  lit: roughness, normals, occlusion; variants day and night
      streetloom export out/demo --format glb --textures factored --to factored/
      streetloom export out/demo --format glb --relief elements --to deep/
      streetloom export out/demo --format 3dtiles --to tiles/
      streetloom export out/demo --format 3dtiles --textures webp --max-texture-mb 300
      streetloom export out/demo --format 3dtiles --textures factored --to factored-tiles/
      streetloom export out/demo --format 3dtiles --night --to night/
      streetloom export out/demo --format 3dtiles --crs native             for a map in the block's CRS
      streetloom export out/demo --format lod3 --building w123949253
      streetloom export out/demo --format gpkg --to demo.gpkg
      streetloom export out/helsinki --format 3dtiles --to tiles/           of the whole city, usable without it
      streetloom export out/helsinki --format gpkg --to helsinki.gpkg
    """
    from flows.step_reporter import show_progress
    from tasks.export.formats import export_run as write

    with show_progress():
        done = write(
            folder,
            style,
            to,
            buildings,
            textures=textures,
            max_texture_mb=max_texture_mb,
            lit=lit,
            night=night,
            crs=crs,
            relief=relief,
        )
    for line in done.notes:
        print_notice(line)
    for file in done.files if len(done.files) <= MAX_LISTED_FILES else [done.path]:
        print_line(file)


@click.command(short_help="Write the STAC catalogue of all runs below a folder.")
@click.argument("folder", metavar="FOLDER", type=EXISTING_OUT)
@click.option("--to", metavar="S3://...", help="Copy the runs with their stores and the catalogue into a bucket.")
def catalog(folder: Folder, to: str | None) -> None:
    """Write FOLDER/catalog.json, the STAC catalogue of all runs in a folder, or of one run.

    \b
    Examples:
      streetloom catalog out
      streetloom catalog out --to s3://bucket/runs
    """
    from catalogs.published.runs import find_runs
    from catalogs.published.s3 import S3Path, folder_at
    from catalogs.published.s3_copy import copy_catalog_to_bucket, copy_run_to_bucket
    from catalogs.stac.catalog import write_catalog
    from facade_core.core.errors import InputError
    from flows.lock import lock_folder

    target = folder_at(to) if to else None
    if to and not isinstance(target, S3Path):
        raise InputError(f"--to {to}: is no bucket; write s3://BUCKET/FOLDER, or copy the folder itself")
    if to and isinstance(folder, S3Path):
        raise InputError(f"{folder}: is in a bucket already; copy it from there to {to} by the bucket's own tools")
    written = write_catalog(folder, on_left_out=print_notice)
    if not isinstance(target, S3Path) or not isinstance(folder, Path):
        print_line(written)
        return
    runs, _ = find_runs(folder)
    for run in runs:
        place = target if run.folder == folder else target / run.name
        with lock_folder(run.folder), lock_folder(place):
            sent = copy_run_to_bucket(run.folder, place)
        print_line(f"{place}: {sent} files sent", err=True)
    if runs[0].folder != folder:
        copy_catalog_to_bucket(folder, target)
    print_line(target / "catalog.json")


@click.command(short_help="Look at a run or a city in a browser, or correct it.")
@click.argument("out", metavar="OUT", type=EXISTING_OUT)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=VIEWER_PORT,
    show_default=True,
    help="Port to listen on; 0 for any free port.",
)
@click.option(
    "--host", default=VIEWER_HOST, show_default=True, help="Address or name to listen on; 0.0.0.0 for all addresses."
)
@click.option("--open/--no-open", "opened", default=True, show_default=True, help="Open the page in a browser.")
@click.option("--edit", is_flag=True, help="Allow corrections of facades from the printed address; see above.")
@click.option("--who", metavar="NAME", help="With --edit: author of the corrections.  [default: this user]")
@click.option(
    "--photos",
    type=EXISTING_FOLDER,
    help="With --edit: photos to assign to walls, after `streetloom match`.",
)
def view(out: Folder, port: int, host: str, opened: bool, edit: bool, who: str | None, photos: Path | None) -> None:
    """Serve a web page of a run or of a city in folder OUT: map, facades by stage, streets, and 3D. Ctrl-C ends it.

    A finished run opens in 3D, a city on its map, also while it is running: a click on a facade, there or in 3D, opens its
    page.

    With --edit, the page can draw, move and delete boxes on facade pictures and set heights, roofs and materials of
    buildings. It stores corrections as `streetloom import` does; a button runs the pending units. With --photos too, the
    page shows the undecided photos of `streetloom match` with their candidate walls and applies decisions as its --take
    does. Only this machine can edit, with the printed address, which is not opened in a browser, because other users could
    read it there.

    \b
    Examples:
      streetloom view out/demo
      streetloom view out/mine --port 0 --no-open      while a run is in progress
      streetloom view out/mine --edit --who anna
      streetloom view out/mine --edit --photos my-photos/
      streetloom view out/helsinki                     a city: all of its blocks on one map and in one model
      streetloom view s3://bucket/helsinki
    """
    from catalogs.printable_text import format_command
    from facade_core.core.errors import InputError
    from flows.cli.interrupts import exit_on_signal
    from flows.lock import is_locked

    if not host.strip():  # an empty host would listen on every address
        raise InputError(f"--host: is empty; name an address, such as {VIEWER_HOST}")
    if who is not None and not edit:
        raise click.UsageError("--who needs --edit")
    if photos is not None and not edit:
        raise click.UsageError("--photos needs --edit")
    target = find_viewed_folder(out, several=photos is None)
    with _viewer_requirements():
        from flows.viewer.app import serve
        from flows.viewer.editing import EditorUser
        from tasks.corrections.correction_import import find_run_block_file
        from tasks.matching.match_table import TABLE
        from tasks.viewing.city_view import CityReader
        from tasks.viewing.run_view import RunReader

    if edit and target.first_run is not None:  # corrections are stored next to the block file
        folder = find_run_block_file(target.first_run).parent
        if photos is not None and not (folder / TABLE).is_file():
            block = find_run_block_file(target.first_run)
            raise InputError(
                f"{folder / TABLE}: there is no such table; write it: {format_command('match', block, photos)}"
            )

    def ready(address: str, seen_by: str | None) -> None:
        if seen_by:
            print_notice(seen_by)
        print_line(f"{address}  (Ctrl-C ends it)")
        if opened and not edit:
            import webbrowser

            # a published run opens in 3D; before that, and of a city, the map shows the progress
            published = not target.is_city and (target.folder / "current").is_file()
            webbrowser.open(f"{address}/#/model" if published else address)

    exit_on_signal(
        "the viewer is closed; what was saved is kept" if edit else "the viewer is closed; the run is as it was"
    )
    reader = CityReader(target.folder, is_locked) if target.is_city else RunReader(target.folder)
    serve(reader, host, port, ready, EditorUser(who or current_user(), photos) if edit else None)


@contextmanager
def _viewer_requirements() -> Iterator[None]:
    """Name the extra that installs a missing package of the viewer."""
    from facade_core.core.errors import InputError

    try:
        yield
    except ModuleNotFoundError as error:
        raise InputError(f"the viewer needs {error.name}; install it with: pip install 'streetloom[viewer]'") from error


@click.command("publish-page", short_help="Write the page of a run or a city as files for any web server.")
@click.argument("out", metavar="OUT", type=EXISTING_OUT)
@click.option("--to", "target", type=FOLDER, required=True, help="New folder, or one with an earlier page.")
def publish_page(out: Folder, target: Path) -> None:
    """Write the page that `streetloom view` serves as files for any web server, read-only.

    FOLDER/index.html has the map, the elevations, the facades with the pictures of their story, and the 3D model. The page
    of viewpoints and the search of a city need `streetloom view`. Whoever has the page sees the pictures of its facades: see
    `attribution` of the run, and `imagery.privacy` of its block file, first.

    \b
    Examples:
      streetloom publish-page out/demo --to site/
      python3 -m http.server --directory site/          to look at it here
    """
    from flows.lock import is_locked

    viewed = find_viewed_folder(out, several=True)
    with _viewer_requirements():
        from flows.viewer.app import create_application
        from flows.viewer.static_page import HOST, StaticPageWriter
        from tasks.viewing.city_view import CityReader
        from tasks.viewing.run_view import RunReader
    reader = CityReader(viewed.folder, is_locked) if viewed.is_city else RunReader(viewed.folder)
    writer = StaticPageWriter(create_application(reader, HOST, HOST), target, lambda line: print_line(line, err=True))
    count = writer.write()
    print_line(f"{target / 'index.html'}  ({count} files)")
