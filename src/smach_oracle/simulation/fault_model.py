"""Faults drawn from a seed, each with the cure that ends it. Pure: no ROS.

This stands in for a physical world: it fails the robot's actions in the four ways that tell the oracle's recoveries
apart (paper, section IV-C and VI-B), so that the whole pipeline can be run and measured before there is a simulated
robot. Its probabilities are settings, not findings.
"""
import random
from typing import Any, Dict, FrozenSet, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

from smach_oracle.oracle.errors import ConfigError

TRANSIENT = 'transient'  # the next attempts fail, then it works again
PRECONDITIONS = 'preconditions'  # works once everything that the state needs has been done again
STEP_BACK = 'step_back'  # works once the step before it in the chain has been done again
EXPERT = 'expert'  # works only by an expert's hand

CURES = (TRANSIENT, PRECONDITIONS, STEP_BACK, EXPERT)

CHAIN = ('MOVE_ARMS_ASIDE', 'POINT_HEAD', 'DETECT_TABLETOP', 'BUILD_COLLISION_MAP', 'PICK', 'PLACE')

# What a state physically needs done before it; a step_back fault strikes only where the step before is not among it.
NEEDS: Mapping[str, FrozenSet[str]] = {
    'DETECT_TABLETOP': frozenset({'MOVE_ARMS_ASIDE'}),
    'PICK': frozenset({'DETECT_TABLETOP', 'BUILD_COLLISION_MAP'}),
}

REASONS: Mapping[str, Sequence[str]] = {
    'MOVE_ARMS_ASIDE': ('no collision-free path for the arm', 'joint trajectory out of tolerance'),
    'POINT_HEAD': ('pan joint stalled', 'tilt joint stalled'),
    'DETECT_TABLETOP': ('no cluster above the table', 'an arm is in the line of sight'),
    'BUILD_COLLISION_MAP': ('point cloud too old', 'no points in the region'),
    'PICK': ('no valid grasp without collision', 'gripper closed on nothing'),
    'PLACE': ('no collision-free place pose', 'object slipped'),
}

DEFAULTS: Dict[str, Any] = {
    'fault_probability': 0.26,  # of a trial having a fault
    'second_fault_probability': 0.15,  # of a faulty trial having one more
    'transient_attempts': 2,  # at most this many attempts fail
    'cure_weights': {TRANSIENT: 0.45, PRECONDITIONS: 0.25, STEP_BACK: 0.2, EXPERT: 0.1},
    'state_weights': {'MOVE_ARMS_ASIDE': 1.0, 'POINT_HEAD': 0.5, 'DETECT_TABLETOP': 4.0, 'BUILD_COLLISION_MAP': 1.0,
                      'PICK': 4.0, 'PLACE': 1.5},
}


class Fault(NamedTuple):
    """One thing that is wrong with the world of a trial."""

    state: str  # whose action it strikes
    cure: str  # one of CURES
    strength: int  # TRANSIENT: attempts that fail; else 0
    reason: str  # what the action says


class FaultSettings:
    """The validated probabilities.

    :raises ConfigError: naming the key, the value and what is allowed.
    """

    def __init__(self, settings: Optional[Mapping[str, Any]] = None) -> None:
        if settings is not None and not isinstance(settings, Mapping):
            raise ConfigError('faults', settings, 'a dictionary with keys among ' + ', '.join(sorted(DEFAULTS)))
        values = dict(DEFAULTS)
        for key, value in (settings or {}).items():
            if key not in DEFAULTS:
                raise ConfigError(key, value, 'one of the keys ' + ', '.join(sorted(DEFAULTS)))
            values[key] = value
        self.fault_probability = _probability('fault_probability', values)
        self.second_fault_probability = _probability('second_fault_probability', values)
        self.transient_attempts = _attempts(values['transient_attempts'])
        self.cure_weights = _weights('cure_weights', values, CURES)
        self.state_weights = _weights('state_weights', values, CHAIN)


def _probability(key: str, values: Mapping[str, Any]) -> float:
    value = values[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= 1.0:
        raise ConfigError(key, value, 'a number from 0 to 1')
    return float(value)


def _attempts(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ConfigError('transient_attempts', value, 'a whole number from 1')
    return value


def _weights(key: str, values: Mapping[str, Any], names: Sequence[str]) -> Dict[str, float]:
    weights = values[key]
    if not isinstance(weights, Mapping) or set(weights) - set(names):
        raise ConfigError(key, weights, 'a dictionary with keys among ' + ', '.join(names))
    for name, value in weights.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < float('inf'):
            raise ConfigError('{}.{}'.format(key, name), value, 'a number from 0')
    if not any(weights.values()):
        raise ConfigError(key, weights, 'at least one weight above 0')
    return dict(weights)


def strikes(cure: str) -> Tuple[str, ...]:
    """The states that a fault with this cure can strike."""
    if cure == PRECONDITIONS:
        return tuple(state for state in CHAIN if NEEDS.get(state))
    if cure == STEP_BACK:
        return tuple(state for before, state in zip(CHAIN, CHAIN[1:]) if before not in NEEDS.get(state, ()))
    return CHAIN


def draw_faults(seed: int, settings: FaultSettings) -> List[Fault]:
    """The faults of a trial; the same seed and settings give the same faults."""
    rng = random.Random(seed)
    if rng.random() >= settings.fault_probability:
        return []
    count = 2 if rng.random() < settings.second_fault_probability else 1
    faults: Dict[str, Fault] = {}
    for _ in range(count):
        fault = _draw_fault(rng, settings)
        if fault is not None:
            faults.setdefault(fault.state, fault)
    return [faults[state] for state in CHAIN if state in faults]


def _draw_fault(rng: random.Random, settings: FaultSettings) -> Optional[Fault]:
    cure = rng.choices(list(settings.cure_weights), list(settings.cure_weights.values()))[0]
    states = [state for state in strikes(cure) if settings.state_weights.get(state)]
    if not states:
        return None
    state = rng.choices(states, [settings.state_weights[name] for name in states])[0]
    strength = rng.randint(1, settings.transient_attempts) if cure == TRANSIENT else 0
    return Fault(state, cure, strength, rng.choice(list(REASONS[state])))


class FaultyWorld:
    """What the actions of one trial find: which of them fail, and why.

    An action that works is told by `attempt` returning ''. An action that fails cures nothing.
    """

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._faults = {fault.state: fault for fault in faults}
        self._attempts_left = {fault.state: fault.strength for fault in faults}
        self._to_do: Dict[str, Set[str]] = {}  # by struck state, once the fault has shown: what cures it
        self.holding = False

    def attempt(self, state: str) -> str:
        """Try the action of `state`.

        :returns: why it failed, or '' where it did not.
        """
        reason = self._strike(state) or self._impossible(state)
        if not reason:
            self._done(state)
        return reason

    def assist(self, state: str) -> None:
        """An expert does the work of `state`; whatever was wrong with it is over."""
        self._faults.pop(state, None)
        self._done(state)

    def _strike(self, state: str) -> str:
        fault = self._faults.get(state)
        if fault is None:
            return ''
        if fault.cure == TRANSIENT:
            self._attempts_left[state] -= 1
            if self._attempts_left[state] <= 0:
                del self._faults[state]
        else:
            self._to_do.setdefault(state, cure_steps(fault))
        return fault.reason

    def _impossible(self, state: str) -> str:
        return 'nothing in the gripper' if state == 'PLACE' and not self.holding else ''

    def _done(self, state: str) -> None:
        if state in ('PICK', 'PLACE'):
            self.holding = state == 'PICK'
        for struck, steps in list(self._to_do.items()):
            steps.discard(state)
            if not steps and struck in self._faults and self._faults[struck].cure != EXPERT:
                del self._faults[struck]
                del self._to_do[struck]


def cure_steps(fault: Fault) -> Set[str]:
    """The actions that end a fault once each of them has worked again; none for an expert's fault."""
    if fault.cure == PRECONDITIONS:
        return set(NEEDS[fault.state])
    if fault.cure == STEP_BACK:
        return {CHAIN[CHAIN.index(fault.state) - 1]}
    return set()
