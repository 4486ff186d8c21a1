"""The data of one wrapped machine beside its states: its place in the tree, records, userdata."""
