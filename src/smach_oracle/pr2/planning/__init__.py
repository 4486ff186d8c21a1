"""Paths for the arms, and obstacles."""
