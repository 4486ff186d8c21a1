"""What a store raises."""


class StoreError(Exception):
    """A store cannot be opened, read or written; the text says which and why."""


class StoreDamaged(StoreError):
    """A store whose content cannot be read."""
