"""The question to an expert, and the answer (paper, section V)."""
