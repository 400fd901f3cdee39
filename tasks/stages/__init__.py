"""The stages of a run, one folder each; `order.py` lists them."""
