"""What may be set, checked. Pure, and without smach."""
