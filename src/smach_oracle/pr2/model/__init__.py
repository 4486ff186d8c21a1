"""The PR2 as a model that physics can move."""
