"""Judging policies from rows alone: accounts of trials, tests of hypotheses, verdicts."""
