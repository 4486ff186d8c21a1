"""Finds the node that has sent a message, and whether it is the one whose message counts."""
