"""Keep a file of the network as a file of this machine: fetched where it is another than last time, by its ETag or date.

python -m deploy.mirror URL FILE
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
from http import HTTPStatus
from http.client import HTTPException, HTTPResponse
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

import click

# Seconds in which a server must say something.
PATIENCE_S = 60
# What a server says of a version, and how it is asked whether there is another.
CONDITIONS = {"ETag": "If-None-Match", "Last-Modified": "If-Modified-Since"}


@click.command()
@click.argument("url")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
def main(url: str, file: Path) -> None:
    """Fetch URL into FILE, in one step, unless it is what it was when it was fetched last."""
    try:
        fetched = mirror(url, file)
    except (URLError, HTTPException, OSError, ValueError) as error:
        sys.exit(f"{url}: {error}; {file} is as it was")
    click.echo(f"{file}: {'fetched' if fetched else 'as it was'}")


def mirror(url: str, file: Path) -> bool:
    """Whether there was another version, which is in the file now. Raises URLError, HTTPException, OSError, ValueError where
    there is none whole; then the file is as it was."""
    if not url.startswith(("http://", "https://")):
        raise ValueError("is no address of the web")
    held = file.with_name(f".{file.name}.json")
    known = _known(held, url) if file.is_file() else {}
    headers = {CONDITIONS[name]: said for name, said in known.items() if name in CONDITIONS}
    try:
        with urlopen(Request(url, headers=headers), timeout=PATIENCE_S) as answer:
            _write(answer, file)
            told = {name: answer.headers[name] for name in CONDITIONS if answer.headers[name]}
    except HTTPError as error:
        if error.code == HTTPStatus.NOT_MODIFIED:
            return False
        raise
    held.write_text(
        json.dumps({"url": url, **told}), encoding="utf-8"
    )  # after the file: without it, that is fetched again
    return True


def _known(held: Path, url: str) -> dict[str, str]:
    """What the server said of the version that is there; nothing where that is of another address."""
    try:
        known = json.loads(held.read_text(encoding="utf-8"))
        return known if known["url"] == url else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _write(answer: HTTPResponse, file: Path) -> None:
    """What a server sends, all of it, over the file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=file.parent, prefix=f".{file.name}.", delete=False) as new:
        try:
            shutil.copyfileobj(answer, new)
            if answer.length:  # of what it said it would send
                raise HTTPException(f"{answer.length} bytes did not come")
            os.chmod(new.name, 0o644)
            os.replace(new.name, file)
        except BaseException:
            Path(new.name).unlink(missing_ok=True)
            raise


if __name__ == "__main__":
    main()
