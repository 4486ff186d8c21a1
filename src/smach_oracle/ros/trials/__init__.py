"""The topic that says what runs on a node."""
