"""Generated blocks of known truth, in drawn combinations of formats and conventions, and how the readers take them."""
