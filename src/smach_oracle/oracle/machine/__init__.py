"""What one wrapped machine keeps beside its states: its place in the tree, records, userdata."""
