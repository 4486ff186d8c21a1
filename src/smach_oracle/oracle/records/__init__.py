"""What the executive remembers and reports: visits, rates, events. No ROS."""
