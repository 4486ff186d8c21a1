"""The messages of robots, followed and made plain."""
