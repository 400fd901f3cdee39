"""Export of published results to other formats."""
