"""Groups of your own trials, compared: by folder, node, host, version, settings or day."""
