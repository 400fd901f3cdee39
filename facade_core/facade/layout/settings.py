"""Settings of layouts."""

# Score (`scores.score`) below which a layout is flagged; set by hand on labelled facades.
MIN_PLAUSIBLE_SCORE = -1.7
