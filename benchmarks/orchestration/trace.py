"""The command line with a clock around the coordinator's calls: SPANS.json, then the arguments of `streetloom`.

Nothing is done differently; the spans, (what, start, end) in seconds since the epoch, are written when the command ends.
"""

from __future__ import annotations

import functools
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

Span = tuple[str, float, float]
spans: list[Span] = []  # append is atomic: tasks run in threads


def main() -> None:
    """Run the command line with the arguments after the first and write the spans to the first."""
    import flows.server.starting
    from flows.cli.commands import main as command

    path = Path(sys.argv[1])
    entered = time.time()
    flows.server.starting.server = _server(flows.server.starting.server)
    try:
        command(sys.argv[2:])
    finally:
        spans.append(("command", entered, time.time()))
        path.write_text(json.dumps(spans))


def _timed(what: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def timed(*args: Any, **kwargs: Any) -> Any:
        start = time.time()
        try:
            return function(*args, **kwargs)
        finally:
            spans.append((what, start, time.time()))

    return timed


def _entered(what: str, manager: Callable[..., AbstractContextManager[Any]]) -> Callable[..., Any]:
    """Times entering a context manager, and leaving it."""

    @contextmanager
    def timed(*args: Any, **kwargs: Any) -> Iterator[Any]:
        start = time.time()
        with manager(*args, **kwargs) as value:
            spans.append((what, start, time.time()))
            yield value
            ending = time.time()
        spans.append((f"{what} end", ending, time.time()))

    return timed


def _server(server: Callable[..., AbstractContextManager[Any]]) -> Callable[..., Any]:
    """Prefect reads its settings when first imported, so the flow's calls get their clocks once the server has set them."""
    timed = _entered("server", server)

    @contextmanager
    def with_clocks(*args: Any, **kwargs: Any) -> Iterator[Any]:
        with timed(*args, **kwargs) as value:
            _timed("imports", _install)()
            type(value).require = _timed("ready", type(value).require)
            yield value

    return with_clocks


def _install() -> None:
    import flows.block as flow
    from tasks.stages import fan_out, streets

    flow.city_block.fn = _timed("flow", flow.city_block.fn)
    flow.connect = _entered("cluster", flow.connect)
    tasks: list[tuple[str, Any]] = [
        ("ingest", flow.ingest_block),
        ("publish", flow.publish_block),
        ("task", fan_out.process_batch),
        ("task", streets.texture_street),
    ]
    for what, task in tasks:
        task.fn = _timed(what, task.fn)
    for name in ("what_is_due", "due_of"):
        setattr(flow, name, _timed("orders", getattr(flow, name)))
    for module in (fan_out, streets):
        for what, name in (("session", "begin"), ("commit", "finish")):
            setattr(module, name, _timed(what, getattr(module, name)))
