"""Rehearse a deployment on this machine: python -m deploy.rehearsal"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import click

from deploy.rehearsal import namespaces, postgres


@click.command()
@click.option("--blocks", default=4, show_default=True, type=click.IntRange(1, 64), help="Blocks of the town.")
@click.option("--cut", default=60.0, show_default=True, help="Seconds for which a worker is cut off.")
@click.option("--bucket/--no-bucket", default=True, show_default=True, help="Run a block in a bucket too.")
@click.option("--folder", type=click.Path(path_type=Path), help="Where all of it goes, to be kept.  [default: none]")
def main(blocks: int, cut: float, bucket: bool, folder: Path | None) -> None:
    """Start every part of a deployment in a network namespace of its own, have things happen to a town that they texture, and
    compare its end with an undisturbed run's. Exits with 77 where this machine allows no namespaces."""
    if reason := namespaces.unfit() or postgres.unfit():
        click.echo(f"skipped: {reason}", err=True)
        sys.exit(77)
    with tempfile.TemporaryDirectory(prefix="rehearsal-") as temporary:
        where = (folder or Path(temporary) / "all").resolve()
        where.mkdir(parents=True)
        asked = [str(where), "--blocks", str(blocks), "--cut", str(cut), "--bucket" if bucket else "--no-bucket"]
        sys.exit(subprocess.run(namespaces.apart("deploy.rehearsal.course", asked)).returncode)


if __name__ == "__main__":
    main()
