"""Machines drawn at random whose failures have causes that no policy sees, to measure policies."""
