"""Robots found and followed."""
