"""Mutants: a module with one small fault put in, and the tests that should see it."""
