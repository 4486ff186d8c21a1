"""What may be set, checked. Pure; no smach."""
