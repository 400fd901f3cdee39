"""Training of the layout model and the layout network."""
