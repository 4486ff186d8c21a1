"""The world that a trial happens in: PyBullet, the PR2's body, its camera, and the judge."""
