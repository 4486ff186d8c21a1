"""Trials as the executive reports them, without an executive: for tests of the recorder and of the
analysis.
"""

import random
from typing import Callable, List

from smach_oracle.oracle.records.events import Event, EventKind

STATES = (
    'MOVE_ARMS_ASIDE',
    'POINT_HEAD',
    'DETECT_TABLETOP',
    'BUILD_COLLISION_MAP',
    'PICK',
    'PLACE',
)
FAULT_SHARE = {'DETECT_TABLETOP': 0.16, 'PICK': 0.11, 'PLACE': 0.03}
EXPERT_SHARE = 0.15  # of the faults


class FakeMachine:
    """Plays a pick and place machine whose faults are drawn from the trial's seed; its clock runs
    as told.
    """

    def __init__(
        self,
        tell: Callable[[Event], None],
        recovers: bool = True,
        path: str = 'PICK_AND_PLACE',
        start_time: float = 1_700_000_000.0,
        state_s: float = 60.0,
    ) -> None:
        self._tell = tell
        self._recovers = recovers
        self._path = path
        self._state_s = state_s
        self.time = start_time
        self._trial_id = ''
        self._seq = 0

    def emit(self, kind: EventKind, **fields: object) -> None:
        """Report one step."""
        self._tell(Event(kind, self._trial_id, self._seq, self.time, self._path, **fields))
        self._seq += 1

    def run(self, seed: int, trial_id: str = '') -> str:
        """Play one trial; returns its outcome."""
        rng = random.Random(seed)
        self._trial_id = trial_id or '{}-{}'.format('with' if self._recovers else 'without', seed)
        self._seq = 0
        self.emit(EventKind.TRIAL_START, data={'initial': [STATES[0]], 'recovers': self._recovers})
        outcome = self._run_states(rng)
        self.emit(EventKind.TRIAL_END, outcome=outcome)
        self.time += self._state_s
        return outcome

    def _run_states(self, rng: random.Random) -> str:
        for state in STATES:
            fails = rng.random() < FAULT_SHARE.get(state, 0.0)
            needs_expert = rng.random() < EXPERT_SHARE
            attempts = rng.choice((1, 1, 1, 2))
            for _ in range(attempts if fails else 0):
                self._visit(state, 'aborted')
                self.emit(
                    EventKind.FAILURE,
                    state=state,
                    outcome='aborted',
                    failure_kind=2,
                    failure_class=1,
                    rate=0.1,
                )
                if not self._recovers:
                    return 'aborted'
                self._recover(state)
            if fails and needs_expert:
                self._visit(state, 'aborted')
                self.emit(
                    EventKind.FAILURE,
                    state=state,
                    outcome='aborted',
                    failure_kind=2,
                    failure_class=3,
                    rate=0.8,
                )
                self._ask(state)
            else:
                self._visit(state, 'succeeded')
        return 'succeeded'

    def _visit(self, state: str, outcome: str) -> None:
        self.emit(EventKind.STATE_START, state=state)
        self.time += self._state_s
        self.emit(EventKind.TRANSITION, state=state, outcome=outcome, target='ORACLE')

    def _recover(self, state: str) -> None:
        self.emit(
            EventKind.DECISION, state=state, outcome='revisit', target=state, text='a first failure'
        )
        self.emit(
            EventKind.JUMP,
            state=state,
            target=state,
            data={'missing_keys': [], 'userdata': 'restore'},
        )

    def _ask(self, state: str) -> None:
        query_id = '{}/{}'.format(self._trial_id, self._seq)
        self.emit(EventKind.DECISION, state=state, outcome='ask')
        self.emit(EventKind.QUERY_OPENED, state=state, query_id=query_id)
        self.time += self._state_s
        self.emit(
            EventKind.QUERY_ANSWERED,
            state=state,
            query_id=query_id,
            outcome='supersede',
            by='operator',
        )
        self.emit(EventKind.SUPERSEDE, state=state, outcome='succeeded', query_id=query_id)
        self.emit(EventKind.JUMP, state=state, target='next')


def play(
    tell: Callable[[Event], None], trials: int, recovers: bool = True, first_seed: int = 0
) -> List[str]:
    """Play trials with consecutive seeds; returns their outcomes."""
    machine = FakeMachine(tell, recovers)
    return [machine.run(first_seed + number) for number in range(trials)]
