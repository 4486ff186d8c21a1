"""From bags of trials to tables and figures.

Needs rosbags and, for figures, matplotlib, neither ROS nor SMACH.
"""
