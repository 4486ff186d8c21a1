"""Machines as graphs, laid out by dot."""
