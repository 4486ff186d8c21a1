"""Random trees: drawn, executed by SMACH under an oracle, and by a model made from doc/ alone."""
