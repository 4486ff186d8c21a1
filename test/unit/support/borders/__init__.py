"""What comes in over each border of the project, drawn by Hypothesis, and what takes it."""
