"""Random trees: drawn, executed by SMACH under an oracle, and by a model written apart from it."""
