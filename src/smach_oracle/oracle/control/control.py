"""The requests of an operator to one tree of machines. Pure.

The machines look at the requests before each state. A request wakes them by one flag of their
engines, `attentive`, which they look at in any case. Without a request a step costs nothing more.
"""

import contextlib
import math
import threading
from dataclasses import dataclass
from enum import Enum
from typing import Dict, Iterator, List, NamedTuple, Optional, Protocol, Tuple, Union

from ..scope.clock import Clock, Flag
from ..scope.scope import Reason, Scope
from ..settings.names import PathPattern
from ..settings.settings import CONFIRM_FIRST


class HeldBy(str, Enum):
    """The reason why a container waits."""

    PAUSE = 'paused'
    BREAKPOINT = 'breakpoint'
    CONFIRM = 'confirm'  # the autonomy of the state


class LetGo(str, Enum):
    """What an operator lets a container go by. A `Reason` may end its wait, too."""

    RESUMED = 'resumed'
    STEPPED = 'stepped'
    CONFIRMED = 'confirmed'
    SENT = 'sent'  # to another state


class HeldPlace(NamedTuple):
    """A state that is about to run, and the path of its container."""

    path: str
    state: str

    def in_words(self) -> str:
        """Return it as people read it."""
        return '{} in {}'.format(self.state, self.path)


@dataclass(eq=False)
class Hold:
    """One wait. `Control` alone writes to it."""

    place: HeldPlace
    held_by: HeldBy
    confirms: bool  # whether it waits for a confirmation
    confirmed: bool = False
    stepped: bool = False
    may_be_sent: bool = True  # whether the container can go to another state from here
    asks: bool = True  # whether the autonomy of its state counts
    autonomy: str = ''  # that by its settings

    def __post_init__(self) -> None:
        self.key = self.place.path  # by which jumps of the container are asked for
        self.changed = Flag()  # an operator has asked for something since it was looked at

    @property
    def waits_for_confirmation(self) -> bool:
        """Whether nobody has confirmed yet that the state may be entered."""
        return self.confirms and not self.confirmed


_SETTLE_S = 1.0  # how long a command waits at most for a container that is being sent


class Engine(Protocol):
    """Wakes a machine that executes (`EngineProbe`)."""

    attentive: bool
    stays_attentive: bool  # whatever the operator wants


class Keyed(Protocol):
    """A container by the key with which its jumps are asked for (`TreeNode`)."""

    @property
    def key(self) -> str:
        """The key, which its place makes up."""


class Jump(NamedTuple):
    """A state to which a container goes at its next state boundary.

    `container`: path of the container of the state. '' means it is the one that goes.
    `after_stop`: whether a preempt stood as it was asked for. A later one goes before it.
    """

    state: str
    by: str = ''
    text: str = ''
    repeats: Tuple[str, ...] = ()  # the guarded states of which it was confirmed that they repeat
    written: Tuple[str, ...] = ()  # userdata keys that were written for it
    container: str = ''
    after_stop: bool = False

    def named(self) -> str:
        """Return the state, with the path of its container where that is another one."""
        return '/'.join((self.container, self.state)) if self.container else self.state


class StandingOrders(NamedTuple):
    """What is asked of a machine, and of the next one in its place, until it is taken back."""

    paused: bool
    paused_by: str
    breakpoints: Dict[str, PathPattern]
    levels: Dict[str, Tuple[PathPattern, str]]


class _OperatorStop(NamedTuple):
    """An operator's stop of the machine, until that goes on or its trial ends."""

    ends_s: float  # from when on it ends what waits, though the preempt has not come to that
    lifts_pause: bool


class Control:
    """Pauses, breakpoints, autonomy levels and jumps of one tree. Safe to use from several threads.

    `is_set`: whether an operator has asked for any of them, so that a machine looks before a state.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.RLock()  # quicker to take than the condition
        self._changed = threading.Condition(self._lock)
        self._engines: Dict[int, Engine] = {}
        self._holds: List[Hold] = []
        self._jumps: Dict[str, Jump] = {}
        self._breakpoints: Dict[str, PathPattern] = {}
        self._levels: Dict[str, Tuple[PathPattern, str]] = {}
        # where containers go, by key, that are sent from where they wait
        self._moving: Dict[str, HeldPlace] = {}
        self._stop: Optional[_OperatorStop] = None
        self.paused = False
        self.paused_by = ''
        self.is_set = False

    # -- of the machines

    def begin_trial(self) -> None:
        """Drop the jumps of the trial before. Its pause, breakpoints and levels stay."""
        with self._changed:
            self._jumps.clear()
            self._moving.clear()
            self._stop = None  # of a stop that came between two trials
            self._note_change()

    def end_trial(self) -> None:
        """Tell nothing more of this trial."""
        with self._changed:
            self._stop = None
            self._note_change()

    def attend(self, engine: Engine) -> None:
        """Wake this machine from now on, and at once where something is set."""
        self._engines[id(engine)] = engine
        self.calm(engine)

    def leave(self, engine: Engine, node: Keyed) -> Optional[Jump]:
        """Forget a machine whose execution is over, and return the jump that it has not made."""
        self._engines.pop(id(engine), None)
        if not (self._moving or self._jumps):
            return None
        with self._lock:
            self.arrived(node.key)
            return self.take_jump(node.key)

    def calm(self, engine: Engine) -> None:
        """Let a machine take the short way again, where nothing is set.

        No lock is needed in this order: who sets something sets `is_set` before it wakes engines.
        """
        engine.attentive = engine.stays_attentive
        if self.is_set:
            engine.attentive = True

    def hold_before(
        self,
        place: HeldPlace,
        confirms: bool,
        breaks: bool = True,
        asked: bool = False,
        obeyed: bool = False,
    ) -> Optional[Hold]:
        """Return the wait before a state, None where the machine may enter it.

        :param confirms: whether the state is entered only once somebody has confirmed it.
        :param breaks: whether breakpoints count.
        :param asked: whether a preempt of its container stands. Then a breakpoint pauses nothing.
        :param obeyed: whether the state before has serviced one.
        """
        with self._lock:
            if self._pauses(asked, obeyed):
                return Hold(place, HeldBy.PAUSE, confirms)
            if breaks and self._breaks_before(place, not asked):
                return Hold(place, HeldBy.BREAKPOINT, confirms)
            return Hold(place, HeldBy.CONFIRM, confirms) if confirms else None

    def _pauses(self, asked: bool, obeyed: bool) -> bool:
        """Whether a pause holds a container. A stop lifts it, and runs no state that it held."""
        stop = self._stop
        if stop is None:
            return self.paused
        return (stop.lifts_pause and asked) or (self.paused and not obeyed)

    def _breaks_before(self, place: HeldPlace, pauses: bool) -> bool:
        """Return whether there is a breakpoint. It pauses the tree where it is meant to."""
        for pattern in self._breakpoints.values():
            if pattern.matches(*place):
                if not pauses:
                    return True
                self.paused, self.paused_by = True, 'breakpoint ' + pattern.text
                self._note_change()
                return True
        return False

    def begin(self, hold: Hold) -> None:
        """Show that a container waits. The operator may let it go from now on."""
        with self._changed:
            self._judge_level(hold)  # it may have been set since it was looked up
            self._holds.append(hold)
            self.arrived(hold.key)

    def end(self, hold: Hold) -> None:
        """Show that it waits no more."""
        with self._changed:
            self._holds.remove(hold)

    def wait(self, hold: Hold, scope: Scope) -> Union[LetGo, Reason]:
        """Wait until a hold that has begun is let go, and return by what.

        :param scope: ends the wait, as a preempt does.
        """
        while True:
            hold.changed.clear()
            with self._changed:
                let_go, stop = self._let_go(hold), self._stop
            reason = scope.reason  # a user's machine has a say in it: not under the lock
            if reason is not None:
                return reason  # it goes before what an operator has asked for since
            if let_go is not None:
                return let_go
            scope.wait(None if stop is None else stop.ends_s - self._clock.now(), hold.changed)

    def _let_go(self, hold: Hold) -> Union[LetGo, Reason, None]:
        if self._stop is not None:  # the preempt is on its way, and lets go what it comes to
            return Reason.PREEMPTED if self._clock.now() >= self._stop.ends_s else None
        if hold.may_be_sent and hold.key in self._jumps:
            return LetGo.SENT
        if hold.stepped:
            return LetGo.STEPPED
        if self.paused or hold.waits_for_confirmation:
            return None
        return LetGo.CONFIRMED if hold.confirmed else LetGo.RESUMED

    def level_of(self, place: HeldPlace, default: str) -> str:
        """Return the autonomy of a state. `default`: by its settings."""
        with self._changed:
            for pattern, level in reversed(list(self._levels.values())):
                if pattern.matches(*place):
                    return level
            return default

    def arrived(self, path: str) -> None:
        """Note that a container does not wait any more, or waits elsewhere."""
        with self._changed:
            if self._moving.pop(path, None) is not None:
                self._note_change()

    def take_jump(self, path: str) -> Optional[Jump]:
        """Return where the container at `path` is to go, once."""
        with self._lock:
            jump = self._jumps.pop(path, None)
            if jump is not None:
                self._note_change()
            return jump

    # -- of the operator

    def orders(self) -> 'StandingOrders':
        """Return what is asked beyond the present trial."""
        with self._changed:
            return StandingOrders(
                self.paused, self.paused_by, dict(self._breakpoints), dict(self._levels)
            )

    def obey(self, orders: 'StandingOrders') -> None:
        """Be asked this, too, beyond the present trial."""
        with self._changed:
            if orders.paused:
                self.paused, self.paused_by = True, orders.paused_by
            self._breakpoints.update(orders.breakpoints)
            self._levels.update(orders.levels)
            self._note_change()

    def pause(self, by: str = '') -> None:
        """Hold every container of the tree at its next state boundary."""
        with self._changed:
            self._stop = None
            if not self.paused:
                self.paused, self.paused_by = True, by
                self._note_change()

    @contextlib.contextmanager
    def stop(self) -> Iterator[None]:
        """Lift the pause for a stop: what waits ends, and nothing is held until it is serviced.

        The machine is preempted meanwhile. Containers may obey before all have heard of it.
        """
        with self._changed:
            self._stop = _OperatorStop(math.inf, self.paused)
        try:
            yield
        finally:
            with self._changed:
                lifts_pause, self.paused, self.paused_by = self.paused, False, ''
                self._stop = _OperatorStop(self._clock.now() + _SETTLE_S, lifts_pause)
                self._note_change()

    def stop_is_over(self) -> None:
        """Hold again what is to be held: the machine goes on after a stop that was serviced."""
        with self._changed:
            if self._stop is not None and self._stop.ends_s != math.inf:
                self._stop = None
                self._note_change()

    @property
    def holds_all(self) -> bool:
        """Whether an operator has paused the tree, and asks no stop of it."""
        return self.paused and self._stop is None

    def resume(self) -> Tuple[Hold, ...]:
        """Lift the pause. Return what waited because of it, or was sent from where it waited."""
        with self._changed:
            held, moving = self.holds(), dict(self._moving) if self.paused else {}
            self.paused, self.paused_by = False, ''
            self._note_change()
            if not moving:
                return held
            self._settle()
            now = [each for each in self.holds() if each.key in moving]
            return (
                *held,
                *now,
                *(
                    Hold(place, HeldBy.PAUSE, False)
                    for key, place in moving.items()
                    if not any(each.key == key for each in now)
                ),
            )

    def step(self, path: str) -> Tuple[Hold, ...]:
        """Let what waits enter one state each, also what waits for a confirmation.

        :param path: of the container. '' means every one.
        :returns: what goes on.
        """
        with self._changed:
            self._settle()
            held = self.holds(path)
            for hold in held:
                hold.stepped = True
            self._wake()
            return held

    def confirm(self, path: str) -> Tuple[Hold, ...]:
        """Confirm the states before which containers wait for that, and return those.

        :param path: of the container. '' means every one.
        """
        with self._changed:
            self._settle()
            held = tuple(each for each in self.holds(path) if each.waits_for_confirmation)
            for hold in held:
                hold.confirmed = True
            self._wake()
            return held

    def _settle(self) -> None:
        """Wait a moment for containers that were just sent from where they waited."""
        self._changed.wait_for(lambda: not self._moving, _SETTLE_S)

    def holds(self, path: str = '') -> Tuple[Hold, ...]:
        """Return what waits now.

        :param path: of the container. '' means every one.
        """
        with self._changed:
            return tuple(
                each
                for each in self._holds
                if self._let_go(each) is None and path in ('', each.place.path)
            )

    def ask_jump(self, path: str, jump: Jump) -> None:
        """Send the container at `path` to a state at its next state boundary.

        A later wish for the same container takes the place of an earlier one.
        """
        with self._changed:
            for hold in self.holds():
                if hold.may_be_sent and hold.key == path:
                    self._moving[path] = HeldPlace(jump.container or hold.place.path, jump.state)
            self._jumps[path] = jump
            self._note_change()

    def jumps(self) -> Dict[str, Jump]:
        """Return the jumps that are still to be made, by path of the container."""
        with self._changed:
            return dict(self._jumps)

    def set_breakpoint(self, pattern: PathPattern) -> None:
        """Pause the tree before each state that is meant."""
        with self._changed:
            self._breakpoints[pattern.text] = pattern
            self._note_change()

    def remove_breakpoint(self, pattern: PathPattern) -> bool:
        """Take a breakpoint away, and return whether there was one. A pause by it stays."""
        with self._changed:
            was_set = self._breakpoints.pop(pattern.text, None) is not None
            self._note_change()
            return was_set

    def breakpoints(self) -> Tuple[str, ...]:
        """Return the patterns of the breakpoints."""
        with self._changed:
            return tuple(self._breakpoints)

    def set_level(self, pattern: PathPattern, level: str) -> None:
        """Set the autonomy of states. The latest setting for a state applies.

        :param level: '' lets the settings decide again.
        """
        with self._changed:
            self._levels.pop(pattern.text, None)
            if level:
                self._levels[pattern.text] = (pattern, level)
            for hold in self._holds:
                if pattern.matches(*hold.place):
                    self._judge_level(hold)
            self._note_change()

    def _judge_level(self, hold: Hold) -> None:
        if hold.asks:
            hold.confirms = self.level_of(hold.place, hold.autonomy) == CONFIRM_FIRST

    def levels(self) -> Dict[str, str]:
        """Return the autonomy that was set at run time, by pattern."""
        with self._changed:
            return {text: level for text, (_, level) in self._levels.items()}

    def _note_change(self) -> None:
        """Wake who waits, and have machines look that execute."""
        self.is_set = bool(
            self.paused
            or self._breakpoints
            or self._levels
            or self._jumps
            or self._moving
            or (self._stop is not None and self._stop.lifts_pause)
        )
        if self.is_set:
            for engine in list(self._engines.values()):
                engine.attentive = True
        self._wake()

    def _wake(self) -> None:
        """Have all that wait look again."""
        for hold in self._holds:
            hold.changed.set()
        self._changed.notify_all()
