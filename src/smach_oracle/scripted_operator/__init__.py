"""A scripted operator who answers questions with the means that people have.

It sees what a person would in the robot's images, and works through the perception and manipulation
interfaces, and by the head and the base.
"""
