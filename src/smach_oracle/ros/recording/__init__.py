"""Bags of trials: written so that a crash loses at most a moment, mended, packed."""
