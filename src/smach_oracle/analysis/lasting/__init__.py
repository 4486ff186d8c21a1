"""Finds the causes of a trial that were still there when its failed state was tried again."""
