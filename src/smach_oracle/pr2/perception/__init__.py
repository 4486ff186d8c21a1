"""Perception by the head camera: tables, objects, the refrigerator's door."""
