"""The web side of the console: who may come in, what pages are sent."""
