"""The store of a tree, held while the tree's program may run trials."""
from typing import Optional

import smach
from smach_oracle.store.codecs import CODECS
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.store_file import NewTrial, StoreFile
from smach_oracle.store.store_writer import Ending, StoreWriter

from ..machine.tree_node import TreeNode
from ..records.facts import TrialEnd
from .checkpointer import Checkpointer
from .structure import structure_of

# what may be resumed: the program was stopped, and the task was not done
_CAN_GO_ON = (TrialEnd.STOPPED, TrialEnd.SHUTDOWN)


class Storing:
    """What one trial leaves in the store that the settings name."""

    def __init__(self, top: TreeNode, began: float) -> None:
        """Hold the machine in the store, and begin.

        `began`: s since the epoch.

        :raises StoreError: where the store cannot be opened, or another process holds the machine.
        """
        settings = top.settings
        self._top = top
        self._lock = MachineLock(settings.checkpoint, top.name)
        self._lock.take()
        try:
            self._store = StoreFile(settings.checkpoint, settings.checkpoint_synchronous)
        except BaseException:
            self._lock.release()
            raise
        structure = structure_of(top)
        self._writer = StoreWriter(
            self._store, NewTrial(top.name, top.trial_id, (*structure,), began),
            settings.checkpoint_wait_s, smach.logwarn)
        self._observer = Checkpointer(top, self._writer, CODECS)
        top.events.observers.insert(0, self._observer)  # before who may hold the machine up

    def end(self, why: TrialEnd, outcome: str, at: float) -> None:
        """Store the last of the trial, and let go of the store."""
        if self._observer in self._top.events.observers:
            self._top.events.observers.remove(self._observer)
        self._observer.last_words()
        self._writer.close(None if why in _CAN_GO_ON else Ending(at, outcome))
        self._store.close()
        self._lock.release()


def begin_storing(top: TreeNode, began: float) -> Optional[Storing]:
    """Return what stores a trial that begins; None where the settings name no store.

    :raises StoreError: see Storing.
    """
    return Storing(top, began) if top.settings.checkpoint else None
