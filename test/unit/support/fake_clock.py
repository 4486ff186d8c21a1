"""A clock for tests of the executive, in which only the test has time pass."""

from smach_oracle.testing.stopped_clock import StoppedClock


class FakeClock(StoppedClock):
    """One that does not begin at 0, so that no time can be taken for a moment.

        clock = FakeClock()
        scope = Scope(clock=clock)
        scope.wait(300.0)  # returns at once
        assert clock.now() == 1300.0

    :param now_s: the time that it shows at first.
    """

    def __init__(self, now_s: float = 1000.0) -> None:
        StoppedClock.__init__(self, now_s)
