"""Shared-autonomy interfaces (paper, section V-A): a person does the failed state's work."""
