"""Objects of the street in exports: their models, and instances in glTF and OpenUSD."""
