"""From bags to the counts of each trial: read in several processes, kept for the next time."""
