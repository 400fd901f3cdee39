"""`python -m tests.pipeline.small_views`: the command line, with views as small as what they show in a test's block.

For runs of which only their course matters: views of the usual size take as long as all the rest of a small block.
"""

from __future__ import annotations

VIEW_SIZE = (150, 240)

if __name__ == "__main__":
    from facade_core.export.pictures import views
    from flows.__main__ import main

    views.VIEW_SIZE = VIEW_SIZE
    main()
