"""Figures and tables of an experiment, from its rows alone."""
