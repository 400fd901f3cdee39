"""Values, errors, class codes and small numerical helpers that every other package uses."""
