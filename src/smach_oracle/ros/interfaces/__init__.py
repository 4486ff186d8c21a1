"""Shared-autonomy interfaces that are started on demand."""
