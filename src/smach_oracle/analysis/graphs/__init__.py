"""Containers as graphs, from structures or from transitions, laid out by dot."""
