"""A person marks the object in the camera image. GrabCut cuts it out."""
