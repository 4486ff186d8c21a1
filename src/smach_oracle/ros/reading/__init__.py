"""Settings files, and the names in them beside those of the machines and of the sources."""
