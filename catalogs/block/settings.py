"""Settings of a block: the values of its keys that are neither paths nor about how files are read."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from catalogs.block.declared_keys import Effect, declared_keys, stated_value
from catalogs.block.keys import BlockFileSettings, TextureSettings
from facade_core.core.types import Privacy


@dataclass(frozen=True)
class WithSettings:
    """Value with the settings of a block file; the frequent ones are attributes.

    Attributes
    ----------
    settings : keys of the block file; files count by the content read.
    """

    settings: BlockFileSettings = field(hash=False)  # some of its keys are lists

    @property
    def texture(self) -> TextureSettings:
        """Return the settings of textures."""
        return self.settings.texture

    @property
    def privacy(self) -> Privacy:
        """Return the treatment of people and vehicles in stored pictures."""
        return self.settings.imagery.privacy

    @property
    def storey(self) -> float:
        """Return the metres per storey."""
        return self.settings.storey

    @property
    def seed(self) -> int:
        """Return the start of every random choice."""
        return self.settings.seed


def select_settings(settings: BlockFileSettings, *effects: Effect) -> dict[str, object]:
    """Return the settings with one of these effects by dotted key; of an absent section its defaults."""
    declared = (one for one in declared_keys(BlockFileSettings).values() if one.key.effect in effects)
    found = {}
    for one in declared:
        has_section = "." not in one.name or stated_value(settings, one.name.rpartition(".")[0]) is not None
        found[one.name] = stated_value(settings, one.name) if has_section else one.default
    return found


def replace_settings(settings: BlockFileSettings, **values: Any) -> BlockFileSettings:
    """Return settings with other values, unchecked: of keys of the file itself, or of `texture`."""
    texture = {name: values.pop(name) for name in list(values) if hasattr(settings.texture, name)}
    return settings.model_copy(update=values | {"texture": replace(settings.texture, **texture)})
