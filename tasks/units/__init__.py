"""What runs on a worker: one unit of work each, on arrays from the store, written through a fork. No Prefect here."""
