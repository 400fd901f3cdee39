"""Harvest of a style library from unposed street pictures."""

# Exemplars of a style library, by default.
MAX_EXEMPLARS = 40
# Said of a harvest without the models that detect faces and plates.
NOT_LOOKED_FOR = (
    "faces and number plates were not looked for; `make detect-setup` installs what does, "
    "and the same command then harvests anew"
)
