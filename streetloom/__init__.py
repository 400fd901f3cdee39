"""Public API of Streetloom: modules that re-export what other programs may rely on, each loaded when it is first used."""

from importlib import import_module
from types import ModuleType

__all__ = ["errors", "history", "labels", "layout", "parse", "rectify", "texture", "types", "variation"]


def __getattr__(name: str) -> ModuleType:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(__all__)}")
    return import_module(f"{__name__}.{name}")
