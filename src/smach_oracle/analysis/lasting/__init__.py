"""Which causes of a trial were still there when its failed state was tried again."""
