"""From one failure to a verdict: judged, preconditions run, decided, asked (paper, IV-C)."""
