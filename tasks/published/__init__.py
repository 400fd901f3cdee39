"""What a run publishes: its steps, its files, and what readers open."""
