"""Training of the shipped models, from data folders to model files."""
