"""Learned rates, kept from program to program in a JSON file that several machines may share.

A crash at any moment leaves the old file or the new one. Who writes reads the file first, and adds
what its machine has learned since it last read or wrote. A lock on the folder keeps others out
meanwhile.

`rates_format` says what is in it.
"""

import contextlib
import gc
import json
import os
from functools import partial
from typing import (
    Any,
    Callable,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    Optional,
    Protocol,
    Sequence,
    Set,
    Tuple,
)

import smach

from ..settings.failure_rule import RULE, FailureRule, rule_in
from .folder_locks import folder_lock, is_claimed
from .rates_format import FORMAT, VERSION, Containers, Labels, Machines, write_machines

DAMAGED = '.damaged'
INHERITS = (
    'Rates file {}: {!r} is new there, and begins with what {} has learned. It has the '
    'same states, and no running program uses that name'
)
FROM_NAMELESS = (
    'Rates file {}: {!r} is new there, and begins with what machines without a name '
    'have learned of its states'
)
OTHER_RULE = (
    'Rates file {}: when the rates of {} were learned, failures were told {}. Now they are told '
    '{}. The rates stay, and change with the coming results'
)
NOT_NAMED = 'by the rule of an earlier version, or by a list'


class Learner(Protocol):
    """A container that learns rates. `records`: its `ContainerRecords`."""

    records: Any

    @property
    def path(self) -> str:
        """Its path, for messages."""

    @property
    def relative_path(self) -> str:
        """Its path below the top machine, '' for that itself."""

    def labels(self) -> Iterable[str]:
        """Return the labels of its states."""

    def learn(self, label: str, learned: Mapping[str, object], is_shared: bool) -> None:
        """Take over what was learned of a state.

        :raises ValueError: where it cannot be read.
        """


def learned_by(containers: Iterable[Learner]) -> Containers:
    """Return what was learned, as the "containers" of a rates file."""
    learners = list(containers)
    learned: Containers = {}
    # the branches of a Concurrence have one path, and each is a state of it
    for learner in learners:
        learned.setdefault(learner.relative_path, {}).update(learner.records.to_come)
    for learner in learners:
        learned[learner.relative_path].update(learner.records.learned())
    return learned


def share_rates(path: str, name: str, learners: Iterable[Learner], rule: FailureRule) -> None:
    """Add to `path` what a machine has learned, and take over what others have added.

    It is written atomically and durably.

    :raises OSError: where it cannot be written, or another program keeps the file locked. The old
        file is then untouched, and the next call adds what this one did not.
    """
    learners, path = list(learners), os.path.realpath(path)
    with _rewritten(path, name, learners, rule) as machines:
        done = _merge(path, machines.setdefault(name, {}), learners)
    for share in done:
        share()


@contextlib.contextmanager
def _rewritten(
    path: str, name: str, learners: Sequence[Learner], rule: FailureRule
) -> Iterator[Machines]:
    """Have what the file has changed by the body, and written."""
    with folder_lock(os.path.dirname(path)):
        machines = _to_change(path)
        yield machines
        machines.states[name] = _labels(learners)
        machines.rules[name] = rule.as_data()
        write_machines(path, machines, name)


def _merge(
    path: str, containers: Containers, learners: Sequence[Learner]
) -> List[Callable[[], None]]:
    """Put what is new of a machine into what its file has. Return what is done once it has it."""
    done: List[Callable[[], None]] = []
    for learner in learners:
        states = containers.setdefault(learner.relative_path, {})
        for label, record in dict(learner.records.by_label).items():
            before = written = record.learned()
            if label in states:
                try:
                    written = record.merged_with(states[label])
                except (ArithmeticError, TypeError, ValueError) as err:
                    _tell_unusable(path, label, learner, err)
            done.append(partial(record.share, before, written))
            states[label] = written
    for learner in learners:
        for label, learned in dict(learner.records.to_come).items():
            containers[learner.relative_path].setdefault(label, learned)
    return done


def write_rates(path: str, name: str, learners: Iterable[Learner], rule: FailureRule) -> None:
    """Write what a machine has learned to `path`, in place of what the file had of it.

    Atomically and durably. What the file has of other machines stays.

    :raises OSError: where it cannot be written. The old file is then untouched.
    """
    learners = list(learners)
    with _rewritten(os.path.realpath(path), name, learners, rule) as machines:
        machines[name] = learned_by(learners)


def read_rates(
    path: str, name: str, learners: Iterable[Learner], is_shared: bool, rule: FailureRule
) -> None:
    """Take over the rates in `path`. `is_shared`: the machine adds to this file later.

    A machine that the file does not know takes over what a machine with the same states has
    learned, once, if no running program uses that name: it was renamed. A file that is not there
    is no matter. One that cannot be read is warned of. A damaged one is set aside as PATH.damaged
    and warned of, and the states start from their priors.
    """
    learners = list(learners)
    if is_shared:
        for learner in learners:
            for record in list(learner.records.by_label.values()):
                record.shared = {}
    try:
        machines = _read(path, 'starting from the priors')
    except OSError as err:
        smach.logwarn(
            'Rates file {} cannot be read, starting from the priors: {}'.format(path, err)
        )
        return
    if machines is None:
        return
    containers, told = (
        (machines[name], machines.rules.get(name))
        if name in machines
        else _inherited(os.path.realpath(path), name, learners, is_shared)
    )
    if any(containers.values()):
        _tell_other_rule(path, name, told, rule)
    for learner in learners:
        for label, learned in containers.get(learner.relative_path, {}).items():
            try:
                learner.learn(label, learned, is_shared)
            except (ValueError, TypeError, AttributeError) as err:
                _tell_unusable(path, label, learner, err)


def _inherited(
    path: str, name: str, learners: Sequence[Learner], is_shared: bool
) -> Tuple[Containers, object]:
    """Return what a machine had learned under its name before, nothing where there is none.

    With it comes the rule by which failures were told then, as plain data.

    The file then has it under the new name, too, and no other machine takes it over. What machines
    without a name have learned stays for the others: in a file of an earlier version it may be of
    several.
    """
    containers: Containers = {}
    told: object = None
    try:
        with folder_lock(os.path.dirname(path)):
            machines = _to_change(path)
            if name in machines:  # by now
                return machines[name], machines.rules.get(name)
            before = _name_before(path, machines, learners)
            if before is None:
                return {}, None
            containers, told = machines[before], machines.rules.get(before)
            tell = smach.logwarn if before else smach.loginfo  # of before names
            tell((INHERITS if before else FROM_NAMELESS).format(path, name, before))
            if is_shared and before:
                machines[name] = containers
                machines.states[name] = _labels(learners)
                machines.renamed[before] = name
                if told is not None:
                    machines.rules[name] = told
                write_machines(path, machines, name)
    except OSError as err:
        smach.logwarn(
            'Rates file {}: that {!r} is new cannot be noted there: {}'.format(path, name, err)
        )
    return containers, told


def _name_before(path: str, machines: Machines, learners: Sequence[Learner]) -> Optional[str]:
    """Return the name of a machine with the same states that no running program has.

    Else '' for machines without a name, where they have learned of any of its states.
    """
    own = _labels(learners)
    found = [
        name
        for name in machines
        if name and name not in machines.renamed and machines.states.get(name) == own
    ]
    if any(label in machines.get('', {}).get(place, {}) for place in own for label in own[place]):
        found.append('')
    free = _unclaimed(path, found)
    if free != found:
        gc.collect()  # machines of this process that are gone may still claim their names
        free = _unclaimed(path, found)
    if not free:
        return None
    return max(free, key=lambda each: (bool(each), sum(map(len, machines[each].values()))))


def _unclaimed(path: str, names: Sequence[str]) -> List[str]:
    return [name for name in names if not is_claimed(path, name, if_unknown=bool(name))]


def _tell_other_rule(path: str, name: str, told: object, rule: FailureRule) -> None:
    """Say that failures were told by another rule when the rates of a machine were learned.

    A file of an earlier version names no rule. It may have been the list that is set now.
    """
    before = rule_in({RULE: told})
    if before != rule and (before is not None or rule.words is None):
        tell = smach.loginfo if before is None else smach.logwarn
        whose = repr(name) if name else 'its states'
        tell(OTHER_RULE.format(path, whose, NOT_NAMED if before is None else before, rule))


def _labels(learners: Sequence[Learner]) -> Labels:
    found: Dict[str, Set[str]] = {}
    for learner in learners:  # the branches of a Concurrence have one path
        found.setdefault(learner.relative_path, set()).update(map(str, learner.labels()))
    return {place: sorted(labels) for place, labels in found.items()}


def _tell_unusable(path: str, label: str, learner: Learner, err: Exception) -> None:
    smach.logwarn(
        'Rates file {}: {!r} of {} cannot be used: {}'.format(path, label, learner.path, err)
    )


def _to_change(path: str) -> Machines:
    """Return what the file has, nothing where it has nothing that can be read.

    :raises OSError: where it is there and cannot be read: it is not to be written then.
    """
    machines = _read(path, 'a new one is written')
    return Machines({}) if machines is None else machines


def _read(path: str, then: str) -> Optional[Machines]:
    """Return what the file has by machine, None where it has nothing that can be read.

    `then`: what a warning says of a damaged one.

    :raises OSError: where it is there and cannot be read.
    """
    try:
        with open(path, encoding='utf-8') as stream:
            content = json.load(stream)
        if not isinstance(content, dict) or content.get('format') != FORMAT:
            raise ValueError('it is no file of {}'.format(FORMAT))
        if content.get('version') != VERSION:
            raise ValueError(
                'it has version {!r}, known is {}'.format(content.get('version'), VERSION)
            )
        machines = content.get('machines', {'': content.get('containers')})
        if not isinstance(machines, dict) or not all(
            isinstance(containers, dict)
            and all(isinstance(states, dict) for states in containers.values())
            for containers in machines.values()
        ):
            raise ValueError('it has no states')
        return Machines(
            machines, content.get('states'), content.get('renamed'), content.get('failure_rules')
        )
    except FileNotFoundError:
        return None
    except (ValueError, RecursionError) as err:
        smach.logwarn(
            'Rates file {} is damaged ({}), {}; {}'.format(path, err, _set_aside(path), then)
        )
        return None


def _set_aside(path: str) -> str:
    try:
        os.replace(path, path + DAMAGED)
    except OSError as err:
        return 'it could not be set aside ({})'.format(err)
    return 'it is kept as {}'.format(path + DAMAGED)
