"""What recorded trials teach of the ways on from failures, and of preconditions."""
