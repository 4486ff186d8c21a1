"""What may end early, and what time it goes by: scopes, clocks, calls in threads of their own."""
