"""Data sets and layouts for training and evaluation."""
