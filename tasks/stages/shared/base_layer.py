"""The stages that write the base layer of the atlas."""

from __future__ import annotations

# In the order in which they write.
BASE_LAYER_STAGES = ("textures", "grounds", "walls", "facades")
