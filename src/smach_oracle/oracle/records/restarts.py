"""Counts how often a trial was started over, and keeps the userdata of its start."""

from typing import Dict, Mapping, Optional, Tuple


class Restarts:
    """The restarts of one trial of a tree.

    `count`: how often its top machine was started over. `is_due`: whether the userdata of the start
    is wanted, and not kept yet.
    """

    def __init__(self) -> None:
        self.begin_trial(False)

    def begin_trial(self, is_wanted: bool) -> None:
        """Forget the trial before. `is_wanted`: whether a policy may start this one over."""
        self.count = 0
        self.is_due = is_wanted
        self._userdata: Mapping[int, Dict[str, object]] = {}

    def keep(self, userdata: Mapping[int, Dict[str, object]]) -> None:
        """Keep snapshots of the userdata of the start, by the id of the node."""
        self.is_due = False
        self._userdata = userdata

    def userdata_of(self, node: object) -> Optional[Dict[str, object]]:
        """Return the userdata with which a container has begun, None where it is not known."""
        return self._userdata.get(id(node))

    def __reduce__(self) -> Tuple[object, ...]:
        """A copied or pickled machine has begun no trial."""
        return Restarts, ()
