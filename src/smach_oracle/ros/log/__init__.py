"""What a node logs, and how often."""
