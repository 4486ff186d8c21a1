"""The actions of shared-autonomy interfaces, and which of them runs for a question."""

from typing import Iterable, Sequence, Set

import rosgraph.names

from smach_oracle.msg import SharedAutonomyActionResult

from ...followed_server import ListedQuestion

_RESULT = '/result'


def interface_actions(topics: Iterable[Sequence[str]]) -> Set[str]:
    """Names of the SharedAutonomy actions. `topics`: with their types, as the master knows them."""
    return {
        topic[: -len(_RESULT)]
        for topic, kind in topics
        if kind == SharedAutonomyActionResult._type and topic.endswith(_RESULT)
    }


def action_of(listed: ListedQuestion) -> str:
    """The resolved name of the action that now runs for a question, or '' where none does."""
    offer = next(
        (each for each in listed.goal.interfaces if each.name == listed.goal.interface), None
    )
    if not listed.goal.interface or offer is None:
        return ''
    return rosgraph.names.resolve_name(offer.action, listed.goal.robot)
