"""What happened in each state, what recoveries cost, and what the expert did."""
