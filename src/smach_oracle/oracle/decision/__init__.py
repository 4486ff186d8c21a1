"""From a situation to a decision: failure rates and policies (paper, IV). Pure; no smach."""
