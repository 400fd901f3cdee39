"""Settings of layouts."""

# Score (`scores.score`) that one in twenty of the 253 real facades of the shipped model does not reach.
MIN_PLAUSIBLE_SCORE = -1.7
