"""Cameras, clouds and robots as a browser can show them."""
