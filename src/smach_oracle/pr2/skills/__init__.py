"""Pick, place, open, close, hand over."""
