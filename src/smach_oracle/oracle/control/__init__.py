"""The operator's hand on a tree of machines: what holds it, and what lets it go."""
