"""A test for two robots of the console that are one machine, published twice. Pure.

A script may run its own introspection server in addition to that of its oracle. Both publish the
same containers, under roots of their own names.
"""

from typing import FrozenSet, Iterable, Mapping, NamedTuple, Set

States = Mapping[str, FrozenSet[str]]  # labels by container path


class Source(NamedTuple):
    """The containers that are published under one name."""

    name: str
    nodes: FrozenSet[str]  # that publish it
    learns: bool  # an oracle tells its rates
    states: States


def copies(sources: Iterable[Source]) -> Set[str]:
    """Names of those that show nothing but what another one shows with its learned rates."""
    listed = list(sources)
    learning = [source for source in listed if source.learns]
    return {
        source.name
        for source in listed
        if not source.learns
        and source.nodes
        and source.states
        and any(
            source.nodes <= other.nodes and _is_part(source.states, other.states)
            for other in learning
        )
    }


def _is_part(part: States, whole: States) -> bool:
    """Whether there is a container in `whole` below which all of `part` is found again."""
    root = min(part, key=len)
    return any(
        all(
            path.startswith(root) and whole.get(top + path[len(root) :]) == states
            for path, states in part.items()
        )
        for top in whole
    )
