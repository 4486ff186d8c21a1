"""Programs with random trees that are killed at random instants, and what must hold then."""
