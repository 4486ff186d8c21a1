"""The limits of what bags and stores take of a disk. They name each file before it goes."""
