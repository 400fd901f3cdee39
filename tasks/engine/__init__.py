"""Run the stages: units of work, their keys, the store and the workers; no stage by name."""
