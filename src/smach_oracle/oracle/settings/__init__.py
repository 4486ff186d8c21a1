"""Settings, and their checks. Pure, and without smach."""
