"""The memory and the reports of the executive: visits, rates, events. No ROS."""
