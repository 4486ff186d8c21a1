"""What happens while a wrapped machine runs: wrapping, trials, steps, the meta state."""
