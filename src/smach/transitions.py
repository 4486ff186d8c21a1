"""The transitions of a state machine: where they lead, and whether they lead somewhere."""

from typing import Any, Collection, List, Mapping, Optional

import smach


def inconsistencies(
    states: Mapping[str, Any],
    transitions: Mapping[str, Mapping[str, Optional[str]]],
    initial: Optional[str],
    outcomes: Collection[str],
) -> List[str]:
    """Return what is wrong with a machine, a sentence each, or nothing where it is consistent."""
    errors = []
    if initial is None:
        errors.append('It has no initial state.')
    elif initial not in states:
        errors.append("Its initial state '%s' is not among its states." % initial)
    known = set(states).union(outcomes)
    for label, drawn in transitions.items():
        if known.issuperset(drawn.values()):
            continue
        unknown = [to for to in drawn.values() if to and to not in known]
        if unknown:
            errors.append(
                "State '%s' leads to %s, which are neither states nor outcomes of the machine."
                % (label, unknown)
            )
        unbound = [outcome for outcome, to in drawn.items() if not to and outcome not in known]
        if unbound:
            errors.append(
                "State '%s' has the outcomes %s, which lead to no state and are no outcomes of the "
                'machine.' % (label, unbound)
            )
    return errors


def search_target(label: str, state: Any, outcome: Any, transitions: Any) -> Optional[str]:
    """Return where an outcome leads that was not found the quick way.

    :raises InvalidTransitionError: where the state has not registered it, or no transition is
        drawn for it.
    """
    registered = state.get_registered_outcomes()
    if outcome not in registered:
        raise smach.InvalidTransitionError(
            "State '%s' (%r) returned '%s', but has registered only the outcomes %s"
            % (label, state, outcome, registered)
        )
    if outcome not in transitions:
        raise smach.InvalidTransitionError(
            "State '%s' has no transition for its outcome '%s', only %s"
            % (label, outcome, transitions)
        )
    target: Optional[str] = transitions[outcome]
    return target


def end_of(label: str, outcome: str, target: Optional[str], registered: Collection[str]) -> str:
    """Return the container outcome in which an outcome ends: of the target's name, else its own.

    :raises InvalidTransitionError: where the container has neither.
    """
    if target is not None and target in registered:
        return target
    if outcome not in registered:
        raise smach.InvalidTransitionError(
            "Outcome '%s' of state '%s' leads to '%s', and neither that nor the outcome itself is "
            'a state or an outcome of the machine.' % (outcome, label, target)
        )
    return outcome
