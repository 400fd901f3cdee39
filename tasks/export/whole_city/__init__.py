"""Exports of a whole city: a part for each block, written once, and what joins the parts."""
