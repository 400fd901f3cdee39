"""Procedural painter of facades with ground truth: pictures of the demo, inputs of benchmarks, tests and training."""
