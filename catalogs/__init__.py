"""What goes in and what comes out: block files, dataset recipes, the catalogue of a block."""
