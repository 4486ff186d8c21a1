"""Recorded trials for a notebook: `smach_oracle.analysis.read`, and rows of what happened."""
