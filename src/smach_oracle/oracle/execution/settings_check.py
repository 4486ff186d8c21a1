"""Checks that the settings of a wrapped machine fit its states."""

from typing import Iterator, List, Set, Tuple, cast

import smach

from ..errors import SettingsError
from ..machine.nesting import paths_below
from ..machine.places import allowed_for, places_of, why_unfit
from ..machine.tree_node import TreeNode
from ..settings.checks import STATE, flag
from ..settings.names import UnfitKind, UnfitName, did_you_mean, matches
from ..settings.preconditions import PreconditionSpec
from ..settings.settings import GROUPS
from ..smach_private import states_of

# settings that keep a state from being run where, or for longer than, its author wants
PROTECTIONS = ('on_retry', 'preconditions', 'time_limit_s')


def check_arguments(
    name: object, expert: object, recover: object, strict: object, health: object
) -> None:
    """Check what a machine is put under an oracle with, beside its settings.

    :raises SettingsError: naming the argument, its value and what is allowed.
    """
    if not isinstance(name, str):
        raise SettingsError('name', name, 'a string')
    if expert is not None and not callable(getattr(expert, 'ask', None)):
        raise SettingsError('expert', expert, 'an Expert, or None')
    flag('recover', recover)
    if not callable(strict):
        flag('strict', strict)
    if health is not None and not callable(health):
        raise SettingsError('health', health, 'a function, or None')


def check_names(top: TreeNode) -> None:
    """Check that each name in the settings stands for something in the tree.

    :raises SettingsError: where one does not, if the node is strict (`Strictness`).
    """
    for unfit in [
        *_unfit_states(top),
        *_unfit_nested(top),
        *_unfit_targets(top),
        *_unfit_outcomes(top),
    ]:
        _complain(top, unfit)


def check_preconditions(node: TreeNode) -> None:
    """Check that preconditions name states that can be run for the state.

    These are others of its container by label, and states of other containers by path.

    :raises SettingsError: where one does not, if the node is strict (`Strictness`).
    """
    for label in node.labels():
        for spec in _preconditions_of(node, label):
            for named in spec.labels():
                why_not = why_unfit(node, label, named)
                if why_not:
                    unfit = _unfit(
                        'states.{}.preconditions'.format(label),
                        named,
                        allowed_for(node, label),
                        'is not allowed: ' + why_not,
                        UnfitKind.PRECONDITION,
                    )
                    _complain(node, unfit)


def _unfit_states(top: TreeNode) -> Iterator[UnfitName]:
    """Yield the names of states and of states of interfaces that no state has."""
    known = _known_names(top)
    settings = top.settings
    named = [
        (
            'states.' + name,
            name,
            UnfitKind.PROTECTION if any(key in given for key in PROTECTIONS) else UnfitKind.NAME,
        )
        for name, given in settings.states.items()
    ]
    named += [
        ('{}.{}.states'.format(GROUPS.key_of('interfaces'), offer.name), name, UnfitKind.NAME)
        for offer, states in settings.interfaces
        for name in states
    ]
    for key, name, kind in named:
        if name not in known and not any(matches(name, each) for each in known):
            yield _no_state(key, name, known, kind)


def _unfit_nested(top: TreeNode) -> Iterator[UnfitName]:
    """Yield the paths and patterns of `nested` that stand for nothing."""
    if isinstance(top.in_force.nested, bool):
        return
    known = sorted(set(paths_below(top.machine)))
    for name in top.in_force.nested:
        if not any(matches(name, path) for path in known):
            allowed = (
                'a path or a pattern of the machines in {}, and of the states of '
                'its Concurrences and Iterators: {}'
            ).format(top.path, ', '.join(known) or 'none')
            problem = 'names nothing in {}{}'.format(top.path, did_you_mean(name, known))
            yield _unfit(GROUPS.key_of('nested'), name, allowed, problem)


def _unfit_targets(top: TreeNode) -> Iterator[UnfitName]:
    """Yield the states to which settings send the machine that are not in the tree."""
    settings, known = top.settings, _known_names(top)
    verb, target = settings.on_no_answer
    named = []
    if verb == 'goto':
        named.append((GROUPS.key_of('on_no_answer'), target))
    if settings.on_resume[0] == STATE:
        named.append((GROUPS.key_of('on_resume'), settings.on_resume[1]))
    prefix = GROUPS.key_of('resume_map') + '.'
    named += [(prefix + old, new) for old, new in settings.resume_map.items()]
    for key, name in named:
        if name.strip('/') not in known:
            unfit = _no_state(key, name, known, UnfitKind.CHECKED)
            yield unfit._replace(name=name.strip('/'))


def _unfit_outcomes(top: TreeNode) -> Iterator[UnfitName]:
    """Yield the outcomes in the settings that no state, and no container, can end with."""
    settings = top.settings
    verb, target = settings.on_no_answer
    named: List[Tuple[str, str, str, UnfitKind]] = []
    if verb == 'give_up':
        named.append((GROUPS.key_of('on_no_answer'), '**', target, UnfitKind.CHECKED))
    for key in ('failure_outcomes', 'intended_outcomes'):
        named += [(key, '**', each, UnfitKind.GENERAL) for each in getattr(settings.defaults, key)]
        named += [
            ('states.{}.{}'.format(name, key), name, each, UnfitKind.CHECKED)
            for name, given in settings.states.items()
            for each in cast('Tuple[str, ...]', given.get(key, ()))
        ]
    for key, name, outcome, kind in named:
        known = _outcomes_of(top, name)
        if known and outcome not in known:
            allowed = 'the outcomes: ' + ', '.join(sorted(known))
            problem = 'is no outcome' + did_you_mean(outcome, known)
            yield _unfit(key, outcome, allowed, problem, kind)


def _outcomes_of(top: TreeNode, name: str) -> Set[str]:
    """Return the outcomes of the states for which a name stands, and with `**` of the top."""
    found = set(top.machine.get_registered_outcomes()) if name == '**' else set()
    for each in places_of(top):
        if matches(name, each.relative_path):
            found.update(states_of(each.node.machine)[each.label].get_registered_outcomes())
    return {each for each in found if isinstance(each, str)}


def _no_state(key: str, name: str, known: Set[str], kind: UnfitKind) -> UnfitName:
    allowed = 'the states of the machine: ' + ', '.join(sorted(known))
    return _unfit(key, name, allowed, 'is no state' + did_you_mean(name, known), kind)


def _unfit(
    key: str, name: str, allowed: str, problem: str, kind: UnfitKind = UnfitKind.NAME
) -> UnfitName:
    return UnfitName(SettingsError(key, name, allowed, problem=problem), name, kind)


def _known_names(top: TreeNode) -> Set[str]:
    return {name for each in places_of(top) for name in (each.label, each.relative_path)}


def _preconditions_of(node: TreeNode, label: str) -> Tuple[PreconditionSpec, ...]:
    if node.site.is_container:
        return node.settings_of(label).preconditions
    # labels given for all states of this label are meant for others: none is beside a branch
    path = '/'.join((node.relative_path, label))
    given = node.settings.states.get(path, {}).get('preconditions', ())
    return cast('Tuple[PreconditionSpec, ...]', given)


def _complain(node: TreeNode, unfit: UnfitName) -> None:
    if callable(node.in_force.strict):
        node.in_force.strict(unfit)
    elif unfit.kind in (UnfitKind.CHECKED, UnfitKind.GENERAL):
        return
    elif node.in_force.strict:
        raise unfit.error
    else:
        smach.logwarn(str(unfit.error))
