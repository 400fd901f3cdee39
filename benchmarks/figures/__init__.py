"""The page of figures: `python -m benchmarks.figures` writes docs/figures.md out of rows.toml and the records beside it.

A record is what a benchmark printed, with its command, date, machine, load and the code that it measured. A row says what is
measured and how its figures stand in the text; the figures themselves are taken out of records (docs/decisions/0104).
"""
