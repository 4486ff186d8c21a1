"""Stores where a trial stands while it runs, and lets a machine go on from there."""
