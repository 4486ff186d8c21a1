"""What robots publish, followed and made plain."""
