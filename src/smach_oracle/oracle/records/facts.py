"""Facts about a trial that events carry in their `data`: who decided, why the trial ended.

Bags that were recorded before events carried them tell the same by the words of a text. Those words
are known here and nowhere else. Pure, and without smach.
"""

from enum import Enum
from typing import Dict, Mapping, Tuple, cast

from ..number_checks import is_whole
from .events import NO_OUTCOME, Event

DECIDED_BY = 'decided_by'  # key in the data of DECISION
# key in the data of JUMP: path of the failed state, where that is in a container below
JUMPED_FROM = 'from'
JUMPED_TO = 'to'  # key in the data of JUMP: path of the state, where it is in a container below
# key in the data of TRANSITION: state, kind, outcome and text of an earlier failure that the
# state has reported, and from which the oracle now recovers
TAKEN_UP = 'taken_up'
# keys in the data of TRIAL_START: where and with what it began, and plain values of its userdata
ORIGIN, INPUTS = 'origin', 'inputs'
ENDED_BY = 'ended_by'  # key in the data of TRIAL_END
# key in the data of TRIAL_END: true where the trial is stored, and another program may resume it
CAN_GO_ON = 'can_go_on'
BRANCHES = 'branches'  # key in the data of CONTAINER_START: states that have oracles of their own
LAST_SEQ = 'last_seq'  # key in the data of RESUMED: number of the last event that was stored
# key in the data of TRANSITION: true where it says nothing of how good the state is
NOT_COUNTED = 'not_counted'
# fields of such a TRANSITION: the author's own, from a failure while the robot was not well
UNCOUNTED: Mapping[str, object] = {
    'text': 'not counted, as the robot is not well',
    'data': {NOT_COUNTED: True},
}

# fields of the TRANSITION of a state that was left for a state of another container
LEFT: Mapping[str, object] = {
    'text': 'left for a state of another container',
    'data': {NOT_COUNTED: True},
}

# fields of the TRANSITION of a state that has ended while a preempt or a shutdown was under way, of
# which its own container has not heard yet: there is no PREEMPT before it
STOPPING: Mapping[str, object] = {'data': {NOT_COUNTED: True}}

# fields of the TRANSITION from a state that was held, and that a preempt has ended before it began
PASSED_BY: Mapping[str, object] = {'text': 'preempted before it began', 'data': {NOT_COUNTED: True}}

_OLD_SPENT = ' spent on it'
_OLD_STOPPED = ('KeyboardInterrupt:', 'SystemExit:')


class Decider(str, Enum):
    """The source of a decision: the policy, a limit, or the author's transitions."""

    POLICY = 'policy'
    MAX_RECOVERIES = 'max_recoveries'  # the limit, outside every policy
    AUTHOR = 'author'  # has drawn a way on above, so that the script is not started over
    BUDGET = 'budget'  # that of the whole trial
    ON_RETRY = 'on_retry'  # where the policy wants to go, a state would be repeated
    HELD_BACK = 'held_back'  # no failure: the machine came to a state that is not to be repeated


class TrialEnd(str, Enum):
    """The reason why a trial ended."""

    OUTCOME = 'outcome'
    ERROR = 'error'  # an exception left the machine
    STOPPED = 'stopped'  # Ctrl-C or SystemExit
    SHUTDOWN = 'shutdown'  # of the program. The machine has no outcome
    INCONSISTENT = 'inconsistent'  # no state could be entered
    KEPT = 'kept'  # nobody has said how a stored trial goes on: it is asked again


def decided_by(event: Event) -> Decider:
    """Return the source of the decision of a DECISION event."""
    stated = _stated(event, DECIDED_BY)
    if stated in [each.value for each in Decider]:
        return Decider(stated)
    old = event.text.endswith(_OLD_SPENT)
    return Decider.MAX_RECOVERIES if old else Decider.POLICY


def told_in_words(data: object) -> Dict[str, str]:
    """Return the facts in the data of an event that its sentence tells, too."""
    if not isinstance(data, Mapping):
        return {}
    return {key: data[key] for key in (JUMPED_TO, DECIDED_BY) if isinstance(data.get(key), str)}


def ended_by(event: Event, entered_a_state: bool) -> TrialEnd:
    """Return why a trial ended, by its TRIAL_END event.

    :param entered_a_state: whether the trial has a STATE_START. Needed for old bags alone.
    """
    stated = _stated(event, ENDED_BY)
    if stated in [each.value for each in TrialEnd]:
        return TrialEnd(stated)
    if event.text.startswith(_OLD_STOPPED):
        return TrialEnd.STOPPED
    if event.text == NO_OUTCOME:
        return TrialEnd.SHUTDOWN if entered_a_state else TrialEnd.INCONSISTENT
    return TrialEnd.OUTCOME if event.outcome else TrialEnd.ERROR


def branches_of(event: Event) -> Tuple[str, ...]:
    """Return the states of a container that just began, where each has an oracle of its own."""
    stated = _stated(event, BRANCHES)
    return tuple(map(str, stated)) if isinstance(stated, (list, tuple)) else ()


def last_stored(event: Event) -> int:
    """Return the number of the last event that was stored before a RESUMED one, -1 for none."""
    stated = _stated(event, LAST_SEQ)
    return cast('int', stated) if is_whole(stated, -1) else -1


def is_counted(event: Event) -> bool:
    """Whether a TRANSITION without a FAILURE before it is a success of its state."""
    return not _stated(event, NOT_COUNTED)


def _stated(event: Event, key: str) -> object:
    return event.data.get(key) if isinstance(event.data, Mapping) else None
