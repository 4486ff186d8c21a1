"""The expert at a terminal."""
