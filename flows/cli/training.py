"""Commands that train the models and run benchmarks."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from flows.cli.output import print_line
from flows.cli.paths import EXISTING_FOLDER, EXISTING_OUT, FOLDER

if TYPE_CHECKING:
    from catalogs.published.folders import Folder


class _TrainCommand(click.Command):
    """Command of `train`: prints the files that it returns; ends in one line where the package `training` is absent."""

    def invoke(self, ctx: click.Context) -> None:
        from facade_core.core.errors import InputError
        from flows.step_reporter import show_progress

        if not _is_installed("training.datasets"):
            raise InputError(
                "train: the package streetloom-training is not installed; in a clone of the project run `make train-setup` "
                "and train there, or `pip install ./training` into this environment"
            )
        with show_progress():
            lines = super().invoke(ctx)
        for line in lines:
            print_line(line)


class _TrainGroup(click.Group):
    command_class = _TrainCommand


@click.group(cls=_TrainGroup, short_help="Train the shipped models, or your own.")
def train() -> None:
    """Train the shipped models from a data folder, or your own models from a run and its corrections.

    \b
    Examples:
      streetloom train parser --data ../shared/data --out parser/
      streetloom train parser --corrections out/mine --out mine/
    """


@train.command("parser")
@click.option("--data", type=EXISTING_FOLDER, help="Folder with facades/ and streetphotos/.")
@click.option(
    "--corrections",
    type=EXISTING_OUT,
    multiple=True,
    metavar="OUT",
    help="Run whose corrected facades are training data.",
)
@click.option("--out", type=FOLDER, required=True, help="Folder of the .onnx, its .json and the training state.")
@click.option("--seed", default=0, show_default=True, help="0 for the shipped network.")
@click.option(
    "--fold", type=click.Choice(["artdeco", "ruemonge2014"]), help="Continue from the network in OUT, for a benchmark."
)
def train_parser(
    data: Path | None, corrections: tuple[Folder, ...], out: Path, seed: int, fold: str | None
) -> list[Path]:
    """Train the facade parser (extra: train; `make train-setup`). Resumes an interrupted training.

    With --fold, trains the network in OUT on the training part of a set whose licence forbids shipping the weights, for
    the benchmark of that set. With --corrections and without --data, fine-tunes the shipped network on the corrected
    facades of runs or folders of runs; `models: {parser: DIR/network.onnx}` in a block file selects the result.

    \b
    Examples:
      streetloom train parser --data ../shared/data --out parser/
      streetloom train parser --corrections out/mine --corrections out/city --out ours/
      streetloom train parser --data ../shared/data --out parser/ --fold artdeco
    """
    from training.datasets.corrected_facades import load_corrected_facades
    from training.parser.train import fine_tune_benchmark_parser, fine_tune_on_corrections, train_shipped_parser

    if corrections and (data or fold):
        raise click.UsageError("--corrections goes on from the shipped network, without --data and --fold")
    if data is None and not corrections:
        raise click.UsageError("name --data, of what is shipped, or --corrections, of runs")
    if data is None:
        return [fine_tune_on_corrections(load_corrected_facades(corrections), out, seed=seed)]
    if fold:
        return [fine_tune_benchmark_parser(data, out, fold, seed=seed)]
    return [train_shipped_parser(data, out, seed=seed)]


@train.command("layout")
@click.option("--data", type=EXISTING_FOLDER, required=True, help="Folder with layouts/.")
@click.option("--out", type=FOLDER, required=True, help="Folder of layouts.json and layout_network.onnx.")
@click.option("--seed", default=1, show_default=True, help="1 for the shipped model.")
@click.option(
    "--fold", type=click.IntRange(0, 4), default=0, show_default=True, help="Fold of every fifth facade to hold out."
)
@click.option("--size", type=click.IntRange(10), help="Maximum number of facades for training.")
@click.option(
    "--corrections", type=EXISTING_OUT, multiple=True, metavar="OUT", help="Run whose corrected facades are added."
)
def train_layout_model(
    data: Path, out: Path, seed: int, fold: int, size: int | None, corrections: tuple[Folder, ...]
) -> list[Path | str]:
    """Train the layout model on four fifths of layouts/cmp.jsonl and on the layouts in metres.

    With torch and a GPU, also trains the layout network, which finds the windows of the first completion.
    With --corrections, also trains on the layouts of corrected facades of runs or folders of runs;
    `models: {layout: DIR/layouts.json}` in a block file selects the result.

    \b
    Examples:
      streetloom train layout --data ../shared/data --out layout/
      streetloom train layout --data ../shared/data --corrections out/mine --out ours/
    """
    from training.datasets.corrected_facades import layout_record, load_corrected_facades
    from training.layout.train import has_gpu, train_layout, train_network

    added = [layout_record(facade) for facade in load_corrected_facades(corrections)] if corrections else []
    model = train_layout(data, out, seed=seed, fold=fold, size=size, corrected=added)
    if not has_gpu():
        return [model, "no layout network: torch (make train-setup) finds no GPU; the trees propose the windows"]
    return [model, train_network(data, out, seed=seed, fold=fold, size=size, corrected=added)]


@train.command("materials")
@click.option("--data", type=EXISTING_FOLDER, required=True, help="Folder with materials/.")
@click.option("--out", type=FOLDER, required=True, help="Folder of materials.npz and its .json.")
def train_material_examples(data: Path, out: Path) -> list[Path]:
    """Extract the grain of materials from photographs.

    \b
    Example:
      streetloom train materials --data ../shared/data --out materials/
    """
    from training.materials import learn_grain_examples

    return [learn_grain_examples(data, out)]


@train.command("windows")
@click.option("--data", type=EXISTING_FOLDER, required=True, help="Folder with facades/ and layouts/.")
@click.option("--out", type=FOLDER, required=True, help="Folder of window_types.json.")
def train_window_types(data: Path, out: Path) -> list[Path]:
    """Train the metric of window types from marked windows and painted facades.

    \b
    Example:
      streetloom train windows --data ../shared/data --out windows/
    """
    from training.windows import train_window_metric

    return [train_window_metric(data, out)]


def _is_installed(module: str) -> bool:
    """Return whether a module is there, without importing it."""
    from importlib.util import find_spec

    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False


class _Benchmark(click.Command):
    """Command that passes --help to the benchmark if one is named."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and not args[0].startswith("-"):
            ctx.help_option_names = []
        return super().parse_args(ctx, args)


@click.command(
    cls=_Benchmark, context_settings={"ignore_unknown_options": True}, short_help="List or run the benchmarks."
)
@click.argument("name", required=False)
@click.argument("options", nargs=-1, type=click.UNPROCESSED)
def bench(name: str | None, options: tuple[str, ...]) -> None:
    """Run a benchmark by name, which prints JSON; without a name, list them. OPTIONS are the benchmark's own.

    \b
    Examples:
      streetloom bench demo_time
      streetloom bench parsing --data ../shared/data
      streetloom bench parsing --help
    """
    import pkgutil
    import subprocess
    from importlib.util import find_spec

    from facade_core.core.errors import InputError

    package = find_spec("benchmarks")
    folders = (package and package.submodule_search_locations) or ()
    modules = sorted(module.name for module in pkgutil.iter_modules(folders))
    summaries = {module: summary for module in modules if (summary := _benchmark_summary(module)) is not None}
    if not summaries:
        raise InputError("bench: benchmarks come with a clone of the project, not with its package; run it there")
    if name is None:
        width = max(map(len, summaries))
        for module, summary in summaries.items():
            print_line(f"{module:{width}}  {summary}")
        return
    if name not in summaries:
        raise click.BadParameter(f"{name}: there is {', '.join(summaries)}", param_hint="NAME")
    # every benchmark prints JSON; --json is accepted for consistency with other commands
    arguments = [option for option in options if option != "--json"]
    sys.exit(subprocess.run([sys.executable, "-m", f"benchmarks.{name}", *arguments], check=False).returncode)


def _benchmark_summary(benchmark: str) -> str | None:
    """Return the first line of a benchmark's docstring, None for a module without a `main`."""
    import ast
    from importlib.util import find_spec
    from pathlib import Path

    spec = find_spec(f"benchmarks.{benchmark}")
    text = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
    code = ast.parse(text)
    if not any(isinstance(part, ast.FunctionDef) and part.name == "main" for part in code.body):
        return None
    first_line = (ast.get_docstring(code) or "").partition("\n")[0]
    return first_line.partition(": `")[0].rstrip(".")
