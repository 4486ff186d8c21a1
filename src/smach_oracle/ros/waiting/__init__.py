"""Waits of the oracle in a world that must be told of them."""
