"""Experiments: jobs of trials with and without the oracle, that can be interrupted and go on."""
