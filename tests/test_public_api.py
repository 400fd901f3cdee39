"""The public API: names that other programs rely on, and what importing it loads."""

from __future__ import annotations

import importlib
import inspect
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

import streetloom
from streetloom.labels import CLASSES, UNKNOWN


@pytest.mark.parametrize("name", streetloom.__all__)
def test_every_module_names_what_it_has(name: str) -> None:
    module = getattr(streetloom, name)
    assert module is importlib.import_module(f"streetloom.{name}")
    assert all(hasattr(module, one) for one in module.__all__)


@pytest.mark.parametrize(
    ("function", "parameters"),
    [
        (streetloom.rectify.rectify, ["photo"]),
        (streetloom.parse.parse, ["image", "model"]),
        (streetloom.parse.elements, ["parsing"]),
        (streetloom.parse.lattice, ["labels", "max_lines", "eta"]),
        (streetloom.variation.encode, ["image", "elements", "seed"]),
        (streetloom.layout.complete, ["observed", "domain", "observed_region", "n", "seed", "model"]),
        (streetloom.layout.score, ["elements", "domain", "model"]),
        (streetloom.history.after_viewpoint, ["out", "street", "step"]),
    ],
)
def test_functions_take_these_parameters(function: Callable[..., Any], parameters: list[str]) -> None:
    assert [name for name in inspect.signature(function).parameters if name in parameters] == parameters


def test_classes_keep_their_codes() -> None:
    assert CLASSES == ("wall", "window", "balcony", "door", "roof", "shop", "sky")
    assert UNKNOWN == 255


def test_an_unknown_module_is_named_with_those_there_are() -> None:
    with pytest.raises(AttributeError, match="no attribute 'parsing'; it has errors, history"):
        streetloom.parsing  # noqa: B018


def test_modules_are_loaded_when_they_are_first_used() -> None:
    code = "import sys, streetloom; print([m for m in sys.modules if m.startswith(('facade_core', 'numpy'))])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
