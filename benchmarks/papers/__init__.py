"""Methods of the papers that no run uses, because another method gives better results.

Each has a test against the paper's definition in tests/benchmarks/papers/, and a row in benchmarks/figures/rows.toml.

- layout paper (Fan et al. 2014): `policy`, `placement`, `policy_optimisation` (section 5), and `completion`, which completes
  layouts by that search, by simulated annealing and by a matrix of low rank. Row `layout_paper`.
- tiles paper: `tile_inpainting` (section 4.3), and `tile_search` (Algo. 2 written out). Rows `inpainting`, `synthesis`.
- floors paper (Konushin & Vezhnevets 2007): `clone_and_split` and `floor_pitch` (section 3). Row `inpainting`.
- variation paper (AlSisan & Mitra 2012): `variation_codec` (section 4). Row `variation`.
- street paper: `translator`, the translation network of section 3 with its training (section 4) and its benchmark
  (`python -m benchmarks.papers.translator`). Row `translator`.
"""
