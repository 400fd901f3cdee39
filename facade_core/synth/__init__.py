"""Procedural painter of facades with ground truth: input of the demo, of tests and of training."""
