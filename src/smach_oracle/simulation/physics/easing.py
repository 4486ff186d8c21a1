"""The progress of a motion that starts and ends at rest."""


def eased(share: float) -> float:
    """Share of the way after a share of the time, both 0 to 1. Its speed is 0 at both ends."""
    return share * share * (3.0 - 2.0 * share)
