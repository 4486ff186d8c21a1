"""Keeps the last seconds before a failure, for the question and for the bag."""
