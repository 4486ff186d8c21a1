"""Questions on ROS: the ExpertQuery server and client, and what they need to know."""
