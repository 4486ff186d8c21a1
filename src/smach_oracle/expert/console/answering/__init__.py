"""Questions on the console: claims, answers, marking, driving."""
