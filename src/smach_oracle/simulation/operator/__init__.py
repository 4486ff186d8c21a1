"""The scripted operator with the real expert means: its eye is the truth, its hands are the interfaces of people."""
