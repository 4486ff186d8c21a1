"""Pictures of a world for people: from where one might stand, and as a video."""
