"""The errors of a store."""


class StoreError(Exception):
    """A store cannot be opened, read or written. The text says which and why."""


class StoreDamaged(StoreError):
    """A store whose content cannot be read."""
