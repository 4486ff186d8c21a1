"""Plain tries against one kind of cause: a retry of the state, the script started over.

In one process, without an executive. A state that is tried again varies its goal as the script
does. A script that is started over remembers nothing. The world's own log says what a try finds of
the cause.
"""

from typing import Callable, Iterable, List, NamedTuple, Sequence

from ..physics.judge import judge
from ..physics.world import World
from ..scenes.scene import Scene
from .pick_and_place import FAILURES, Rehearsal

RETRIES, RESTARTS = 3, 2
SETTLING = 60  # control periods at the end of a trial, before it is judged
ROBUST, FUTILE = 0.9, 0.1  # shares: see label()


class RehearsedTrial(NamedTuple):
    """The course of one trial."""

    seed: int
    kind: str  # of its cause
    failed: str  # the state that failed first, '' for none
    cured_by: str  # '', 'retry' or 'restart'
    # whether the cause was there when the failed state was tried again, the first time, and when it
    # was tried again after a restart. It is False where it was not tried
    there_at_retry: bool
    there_at_restart: bool
    success: bool  # in truth

    @property
    def ended(self) -> str:
        """'no failure', 'retry', 'restart', 'false success' or 'failed'."""
        if self.failed and not self.cured_by:
            return 'failed'
        if not self.success:
            return 'false success'
        return self.cured_by or 'no failure'


class _Tries:
    """The tries of one trial."""

    def __init__(self, world: World, trial: Rehearsal, kind: str) -> None:
        self._world, self._states, self._kind = world, trial.states, kind
        self._since = world.time
        self.failed = ''  # the state that failed first
        self.there = {'retry': False, 'restart': False}

    def go(self, first: int, retries: int, again: str = '') -> int:
        """Do the states from one on, each with so many retries.

        :param again: what is noted when the state that failed first is tried again.
        :returns: the number of the state that failed for good, -1 for none.
        """
        for number in range(first, len(self._states)):
            for attempt in range(1 + retries):
                if again and self._states[number][0] == self.failed:
                    self._note(again)
                if self._done(number):
                    break
                again = again or ('retry' if attempt == 0 else '')
            else:
                return number
            again = again if again == 'restart' else ''
        return -1

    def _done(self, number: int) -> bool:
        name, work = self._states[number]
        try:
            work()
        except FAILURES:
            self.failed = self.failed or name
            return False
        return True

    def _note(self, what: str) -> None:
        now = self._world.time - self._since
        self.there[what] |= any(
            span.there_at(now) for span in self._world.cause_spans() if span.kind == self._kind
        )


def run_scene(scene: Scene, world: World, task: Callable[[World], Rehearsal]) -> RehearsedTrial:
    """One trial of a scene with one cause: retries of the state that fails, then restarts."""
    world.reset(scene)
    kind = scene.causes[0].kind
    trial = task(world)
    tries = _Tries(world, trial, kind)
    cured = ''
    left = tries.go(0, RETRIES)
    if tries.failed:
        cured = 'retry' if left < 0 else ''
        for _ in range(RESTARTS):
            if left >= 0:
                trial.begin()
                left = tries.go(0, 0, 'restart')
                cured = 'restart' if left < 0 else ''
    world.step(SETTLING)
    return RehearsedTrial(
        scene.seed,
        kind,
        tries.failed,
        cured,
        tries.there['retry'],
        tries.there['restart'],
        judge(world, scene.goal).success,
    )


def scenes_of(
    draw: Callable[[int], Scene], kind: str, count: int, seeds: Iterable[int]
) -> List[Scene]:
    """The first scenes of these seeds that have this cause, and no other."""
    found: List[Scene] = []
    for seed in seeds:
        if len(found) == count:
            break
        scene = draw(seed)
        if [cause.kind for cause in scene.causes] == [kind]:
            found.append(scene)
    return found


def label(courses: Sequence[RehearsedTrial]) -> str:
    """'robust', 'mixed' or 'futile' under plain retries of the state that fails.

    Robust: ROBUST of the trials and more end well without a restart. Futile: of those that fail at
    first, FUTILE at most end well by a retry. A false success counts as a failure that no retry
    cures: nobody notices it.
    """
    well = sum(each.ended in ('no failure', 'retry') for each in courses)
    failing = sum(each.ended != 'no failure' for each in courses)
    cured = sum(each.ended == 'retry' for each in courses)
    if well >= ROBUST * len(courses):
        return 'robust'
    return 'futile' if cured <= FUTILE * failing else 'mixed'
