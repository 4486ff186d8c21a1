"""The closed set of commands that a page may give."""
