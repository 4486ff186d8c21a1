"""A scripted operator who answers questions with the interfaces that people use.

It sees the world as it truly is, and works through the perception and manipulation interfaces.
"""
