"""The names in the settings that no machine has which `oracle_run --check` has reached."""

from typing import List, Set, Tuple

import smach
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.settings.names import UnfitKind, UnfitName

from ..reading.known_names import is_known, names_of_process, with_way_out
from ..reading.source_labels import is_in_sources


class CheckedNames:
    """Collects names that a machine does not have, until all machines are known.

    One file serves all machines of a script: a name is a mistake if none of them has it, and no
    source mentions it.
    """

    def __init__(self) -> None:
        self._unfit: List[UnfitName] = []
        self._known: Set[str] = set()
        self._placed: Set[Tuple[str, str]] = set()

    def note(self, placed: Set[Tuple[str, str]]) -> None:
        """Take notice of the machines that there are now.

        `placed`: preconditions that fit one of them, by key and name.
        """
        self._known |= names_of_process()
        self._placed |= placed

    def complain(self, unfit: UnfitName) -> None:
        """Note a name that a machine does not have."""
        if unfit.kind is UnfitKind.PRECONDITION:
            smach.logwarn(str(unfit.error))
        else:
            self._unfit.append(unfit)

    def mistakes(self) -> List[SettingsError]:
        """Return an error for each name that nothing has, each once."""
        return [
            unfit.error if unfit.kind is UnfitKind.MISPLACED else with_way_out(unfit)
            for unfit in self._unknown(in_sources=False)
        ]

    def doubts(self) -> List[SettingsError]:
        """Return an error for each name that is no mistake, and that no machine has."""
        return [unfit.error for unfit in self._unknown(in_sources=True)]

    def _unknown(self, in_sources: bool) -> List[UnfitName]:
        found = {str(unfit.error): unfit for unfit in self._unfit if not self._is_known(unfit)}
        return [unfit for unfit in found.values() if in_sources is self._may_be_made(unfit)]

    def _is_known(self, unfit: UnfitName) -> bool:
        if unfit.kind is UnfitKind.MISPLACED:
            return _place_of(unfit.error) in self._placed
        return is_known(unfit.name, self._known)

    def _may_be_made(self, unfit: UnfitName) -> bool:
        return not is_known(unfit.name, self._known) and (
            unfit.kind is UnfitKind.GENERAL or is_in_sources(unfit.name)
        )


def _place_of(error: SettingsError) -> Tuple[str, str]:
    return error.key.rsplit(': ', 1)[-1], str(error.value)
