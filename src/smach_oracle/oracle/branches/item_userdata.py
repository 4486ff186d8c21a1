"""Userdata of an Iterator that goes on: as it was when the unfinished item began."""

from typing import Any, Callable, Dict, Mapping, Optional, Sequence

import smach

from ..machine.snapshots import restore, take_snapshot
from ..smach_private import data_of

Warn = Callable[[str, str], None]


class ItemUserdata:
    """Remembers what an Iterator was given, and its userdata at the beginning of the item.

    `deep_copy_keys`: see the setting. `warn`: see `take_snapshot`.
    """

    def __init__(self, iterator: smach.Container) -> None:
        self._iterator = iterator
        self._given: Dict[str, Any] = {}  # its io keys when it began
        # its userdata as the item under way began
        self.at_item: Optional[Dict[str, Any]] = None

    def begin_item(
        self, begun: Optional[Mapping[str, Any]], deep_copy_keys: Sequence[str], warn: Warn
    ) -> None:
        """Note that an item begins.

        `begun`: the userdata with which its state was begun before the program was stopped. That
        visit has written already.
        """
        data = data_of(self._iterator.userdata) if begun is None else begun
        self.at_item = take_snapshot(data, deep_copy_keys, warn)

    def begin(
        self, userdata: Optional[smach.UserData], deep_copy_keys: Sequence[str], warn: Warn
    ) -> None:
        """Note what it is given as it begins with its first item. `userdata`: of what is above."""
        self._given = take_snapshot(self._inputs_and_outputs(userdata), deep_copy_keys, warn)

    def take_back(self, deep_copy_keys: Sequence[str]) -> None:
        """Take back what the unfinished item wrote."""
        if self.at_item is not None:
            restore(data_of(self._iterator.userdata), self.at_item, (), deep_copy_keys)

    def to_keep(self, userdata: Optional[smach.UserData]) -> Dict[str, Any]:
        """Return what finished items have left under keys that are inputs and outputs.

        It stays where the container above has the value again with which the Iterator began.
        `userdata`: what its inputs are copied from.
        """
        own = data_of(self._iterator.userdata)
        return {
            key: own[key]
            for key, value in self._inputs_and_outputs(userdata).items()
            if key in own and key in self._given and _same(self._given[key], value)
        }

    def _inputs_and_outputs(self, userdata: Optional[smach.UserData]) -> Dict[str, Any]:
        iterator = self._iterator
        both = set(iterator.get_registered_input_keys()).intersection(
            iterator.get_registered_output_keys()
        )
        return {} if userdata is None else {key: userdata[key] for key in both if key in userdata}

    def __getstate__(self) -> Dict[str, Any]:
        return dict(self.__dict__, _given={}, at_item=None)


def _same(one: object, other: object) -> bool:
    if one is other:
        return True
    try:
        return type(one) is type(other) and bool(one == other)
    except Exception:  # whatever a user's object raises, or an array that is no truth
        return False
