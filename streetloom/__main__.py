"""Run the command line as `python -m streetloom`."""

from flows.__main__ import main

if __name__ == "__main__":
    main()
