"""The contents of a trial's world, and why it may fail."""
