"""Runs wrapped machines: wrapping, trials, steps, the meta state."""
