"""Recorded trials, followed as an oracle would have lived them."""
