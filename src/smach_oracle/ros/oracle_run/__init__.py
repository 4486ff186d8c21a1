"""Unmodified scripts under an oracle."""
