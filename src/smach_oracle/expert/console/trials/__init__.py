"""Trials on the console: those that run, and those of bags."""
