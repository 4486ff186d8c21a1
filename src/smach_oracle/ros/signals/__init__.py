"""The signals of a process, and what hears them."""
