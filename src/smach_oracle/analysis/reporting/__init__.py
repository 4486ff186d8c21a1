"""A report on recorded trials: one page that needs nothing else."""
