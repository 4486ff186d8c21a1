"""The people at the consoles: their acts, the times that these took, and their notes."""
