"""A wheeled robot without arms that reads gauges, and its world. It knows no other room."""
