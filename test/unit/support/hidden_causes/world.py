"""The hidden world of one machine: conditions that states make, need and break, and time changes.

A state of a machine is executed in the world by `World.execute`. It does its work if all conditions
hold that it needs. Otherwise it may notice that, and fails, or it says success and has done
nothing. Nothing here knows the ways of a policy.

* A condition holds once a state that *makes* it has done its work, by its chance.
* It is broken by a *disturbance*, by a state that *uses it up*, or as it *fades*.
* A broken one *heals* after a time that is drawn, or never.
* A person can make it hold, if it is *by hand*.
* A state that tries although it is broken may make it *worse*: harm, or a person alone can mend it,
  or nobody can, or another condition breaks.
* A state that knows another *variant* of its work manages without it, from that variant on.
"""

import math
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

from fake_clock import FakeClock

from .chance import drawn, exponential
from .mix import Mix

HARM, ONLY_BY_HAND, FOR_GOOD, SPREADS = 'harm', 'only by hand', 'for good', 'spreads'
PERIOD = 200.0  # trials of a drift


class Condition(NamedTuple):
    """Something that is true or not, and that no policy sees."""

    name: str
    makers: Mapping[str, float] = {}  # chance, by path of a state
    holds_at_first: bool = False
    is_goal: bool = False
    used_up_by: str = ''  # path of a state
    heals_s: Optional[float] = None  # mean
    fades_s: Optional[float] = None  # mean
    is_by_hand: bool = True
    variant: int = 0  # that manages without it, 0 for none
    worse: float = 0.0  # chance, at each try
    worsens: str = HARM
    spreads_to: str = ''
    noticed: float = 1.0
    misnamed: float = 0.0


class Disturbance(NamedTuple):
    """Breaks conditions as a state begins."""

    name: str
    before: str  # path of the state
    chance: float
    breaks: Tuple[str, ...]
    drift: str = 'steady'

    def chance_in(self, trial: int) -> float:
        """Return its chance at the first execution in a trial of that number."""
        return min(1.0, self.chance * _DRIFTS[self.drift](trial / PERIOD))


_DRIFTS = {
    'steady': lambda part: 1.0,
    'rising': lambda part: 0.4 + 1.2 * part,
    'falling': lambda part: 1.6 - 1.2 * min(part, 1.0),
    'step': lambda part: 0.4 if part < 0.5 else 1.6,
    'wave': lambda part: 1.0 + 0.8 * math.sin(4.0 * math.pi * part),
}


class Work(NamedTuple):
    """What a state does in the world."""

    needs: Tuple[str, ...] = ()
    takes_s: float = 10.0  # median
    noise: float = 0.0
    is_once: bool = False  # it harms to do again what is done
    can_fail: bool = True
    appends_to: str = ''  # key of the userdata
    in_place: bool = False
    reads: str = ''  # key of a list that another state appends to


class Causes(NamedTuple):
    """All that a world is made of, by seed of the machine."""

    seed: object
    conditions: Mapping[str, Condition]
    disturbances: Sequence[Disturbance]
    works: Mapping[str, Work]  # by path of a state


class Effect(NamedTuple):
    """How an execution has ended, and what the state says of it."""

    works: bool
    text: str = ''


class World:
    """The conditions of one trial, and what the trial has cost so far."""

    def __init__(self, causes: Causes, mix: Mix, clock: FakeClock) -> None:
        self.causes = causes
        self.clock = clock
        self._mix = mix
        self._makes: Dict[str, List[Condition]] = {}
        self._uses_up: Dict[str, List[Condition]] = {}
        for condition in causes.conditions.values():
            self._uses_up.setdefault(condition.used_up_by, []).append(condition)
            for path in condition.makers:
                self._makes.setdefault(path, []).append(condition)
        self._before: Dict[str, List[Disturbance]] = {}
        for disturbance in causes.disturbances:
            self._before.setdefault(disturbance.before, []).append(disturbance)
        self.begin(0)

    def begin(self, trial: int) -> None:
        """Begin a trial: a person has set right what was wrong."""
        self.trial = trial
        self.began_s = self.clock.now()
        self.harmed: Set[str] = set()  # what is harmed once cannot be harmed again
        self.failures = 0
        self.expert_s = 0.0
        self.last_failed = ''  # path
        self._visits: Dict[str, int] = {}
        self._broken = {
            name: not each.holds_at_first for name, each in self.causes.conditions.items()
        }
        self._changes_s: Dict[str, float] = {}  # when time turns it over
        self._times: Dict[str, int] = {}  # it was broken or made
        self._stuck: Set[str] = set()  # a person alone can mend it
        self._lost: Set[str] = set()  # nobody can

    # -- conditions

    def holds(self, name: str) -> bool:
        """Whether a condition holds now."""
        due_s = self._changes_s.get(name)
        if due_s is not None and due_s <= self.clock.now():
            if self._broken[name]:
                self._make(name)
            else:
                self.spoil(name)
        return not self._broken[name]

    def _turn(self, name: str, broken: bool, mean_s: Optional[float]) -> None:
        self._broken[name] = broken
        self._changes_s.pop(name, None)
        if mean_s is not None:
            times = self._times[name] = self._times.get(name, 0) + 1
            self._changes_s[name] = self.clock.now() + exponential(
                mean_s, self.causes.seed, self.trial, name, broken, times
            )

    def spoil(self, name: str) -> None:
        """Break a condition. One that is broken stays so as long as it would have."""
        if not self._broken[name]:
            self._turn(name, True, self.causes.conditions[name].heals_s)

    def _make(self, name: str) -> None:
        if name not in self._stuck:
            self._turn(name, False, self.causes.conditions[name].fades_s)

    def can_mend(self, name: str) -> bool:
        """Whether a person can make it hold."""
        return self.causes.conditions[name].is_by_hand and name not in self._lost

    def mend(self, name: str) -> None:
        """Have a person make a condition hold."""
        self._stuck.discard(name)
        self._make(name)

    def heals_in_s(self, name: str) -> Optional[float]:
        """Return how long a broken condition takes to heal, None where it does not."""
        due_s = self._changes_s.get(name)
        return None if due_s is None or not self._broken[name] else due_s - self.clock.now()

    def remade_by(self, name: str) -> Sequence[str]:
        """Return the paths of the states that would make a condition hold."""
        return () if name in self._stuck else tuple(self.causes.conditions[name].makers)

    def lacking(self, path: str, variant: int = 0) -> List[Condition]:
        """Return the conditions that a state needs and that do not hold."""
        conditions = [self.causes.conditions[name] for name in self.causes.works[path].needs]
        return [
            each
            for each in conditions
            if not self.holds(each.name) and not 0 < each.variant <= variant
        ]

    def is_goal_met(self) -> bool:
        """Whether the trial's work is done."""
        return all(
            self.holds(name) for name, each in self.causes.conditions.items() if each.is_goal
        )

    # -- states

    def execute(self, path: str, variant: int = 0, has_doubles: bool = False) -> Effect:
        """Execute a state, by its variant of that number.

        :param has_doubles: whether the list that it reads has something twice.
        """
        work = self.causes.works[path]
        visit = self._visits[path] = self._visits.get(path, 0) + 1
        self._disturb(path, visit)
        self.clock.advance(self._time(work, path, visit))
        lacking = self.lacking(path, variant)
        if work.is_once and self._is_done(path):
            self.harmed.add('repeats ' + path)
        for condition in lacking:
            self._worsen(condition, path, visit)
        noticed = [
            each
            for each in lacking
            if self._drawn('notices', path, each.name, visit) < each.noticed
        ]
        is_noise = self._drawn('noise', path, visit) < work.noise
        if work.can_fail and (noticed or is_noise):
            self._use_up(path, visit, 0.5)
            return self._fail(path, noticed, visit)
        self._use_up(path, visit, 1.0)
        self._finish(path, visit, bool(lacking), has_doubles)
        return Effect(True)

    def _finish(self, path: str, visit: int, is_spoiled: bool, has_doubles: bool) -> None:
        """Have a state that says success make what it makes, if it has done its work."""
        if has_doubles:
            if self._drawn('doubles', path, visit) < self._mix.double_harms:
                self.harmed.add('doubles ' + path)
            else:
                is_spoiled = True
        for condition in self._makes.get(path, ()):
            chance = condition.makers[path]
            if is_spoiled:
                if not condition.holds_at_first:
                    self.spoil(condition.name)  # what it has done is not what was wanted
            elif self._drawn('makes', path, condition.name, visit) < chance:
                self._make(condition.name)

    def do_by_hand(self, path: str) -> None:
        """Have a person do the work of a state."""
        for condition in self._makes.get(path, ()):
            self.mend(condition.name)

    def _is_done(self, path: str) -> bool:
        products = [each for each in self._makes.get(path, ()) if not each.holds_at_first]
        return bool(products) and all(self.holds(each.name) for each in products)

    def _disturb(self, path: str, visit: int) -> None:
        for each in self._before.get(path, ()):
            chance = each.chance_in(self.trial) * (1.0 if visit == 1 else self._mix.again)
            if self._drawn('disturbs', each.name, visit) < chance:
                for name in each.breaks:
                    self.spoil(name)

    def _worsen(self, condition: Condition, path: str, visit: int) -> None:
        if self._drawn('worsens', path, condition.name, visit) >= condition.worse:
            return
        if condition.worsens == HARM:
            self.harmed.add(condition.name)
        elif condition.worsens == SPREADS:
            self.spoil(condition.spreads_to)
        else:
            self._stuck.add(condition.name)
            self._changes_s.pop(condition.name, None)
            if condition.worsens == FOR_GOOD:
                self._lost.add(condition.name)

    def _use_up(self, path: str, visit: int, chance: float) -> None:
        for used in self._uses_up.get(path, ()):
            if self._drawn('uses up', path, used.name, visit) < chance:
                self._turn(used.name, True, None)

    def _fail(self, path: str, noticed: Sequence[Condition], visit: int) -> Effect:
        self.failures += 1
        self.last_failed = path
        if not noticed:
            return Effect(False, 'did not work')
        name = noticed[0].name
        if self._drawn('names', path, name, visit) < noticed[0].misnamed:
            others = sorted(self.causes.conditions)
            name = others[int(self._drawn('other', path, name, visit) * len(others))]
        return Effect(False, 'not {}'.format(name))

    def _time(self, work: Work, path: str, visit: int) -> float:
        # the sum of four is near enough to a normal distribution
        parts = sum(self._drawn('takes', path, visit, part) for part in range(4))
        return work.takes_s * math.exp(self._mix.spread * math.sqrt(3.0) * (parts - 2.0))

    def _drawn(self, *names: object) -> float:
        return drawn(self.causes.seed, self.trial, *names)
