"""The kinds of units that a run is made of: which there are, what each needs, how it is found again after a change."""
