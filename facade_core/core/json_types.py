"""Types of documents that are parsed from JSON, YAML or TOML, or written as such."""

from __future__ import annotations

from typing import Any, TypeAlias

# A checker cannot know the types inside a parsed document: readers check every value that they use.
JsonObject: TypeAlias = dict[str, Any]
JsonValue: TypeAlias = "JsonObject | list[Any] | str | int | float | bool | None"
