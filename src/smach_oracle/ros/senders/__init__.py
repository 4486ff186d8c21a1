"""Which node has sent a message, and whether that is the one whose message counts."""
