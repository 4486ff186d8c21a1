"""What a trial's world is made of, and why it may fail."""
