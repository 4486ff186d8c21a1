"""Groups of your own trials, compared: by folder, node, settings and more."""
