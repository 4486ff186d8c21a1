"""Random trees: drawn, executed by SMACH under an oracle, and by a model written from doc/ alone."""
