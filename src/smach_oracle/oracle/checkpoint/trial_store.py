"""The store of one trial: opened before it begins, held while it runs."""
import time
from typing import Optional

import smach
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.rows import StoredTrial
from smach_oracle.store.store_file import NewTrial, StoreFile
from smach_oracle.store.store_writer import Ending, StoreWriter

from ..machine.tree_node import TreeNode
from ..records.facts import TrialEnd
from ..settings.on_resume import ASK, RESTART
from .checkpointer import ENDED, Checkpointer
from .resuming import Resumption, go_on
from .storable import CODECS
from .stored_tree import read_tree
from .structure import differences, structure_of

# what may be resumed: the program was stopped, and the task was not done
_CAN_GO_ON = (TrialEnd.STOPPED, TrialEnd.SHUTDOWN)
RESTARTED = 'restarted'  # in place of the outcome of a trial that was given up for a new one


class TrialStore:
    """What one trial leaves in the store that the settings name."""

    def __init__(self, top: TreeNode) -> None:
        """Hold the machine in the store.

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
        self._structure = structure_of(top)

    def to_resume(self) -> Optional[Resumption]:
        """Return the trial that goes on, None where a new one begins."""
        try:
            return self._to_resume()
        except BaseException:
            self._let_go()
            raise

    def _to_resume(self) -> Optional[Resumption]:
        trials = self._store.trials(self._top.name)
        last = trials[-1] if trials else None
        if last is None or last.ended is not None or not last.moments:
            return None
        tree = read_tree(self._store, last.number, CODECS)
        top = tree.container(self._top.key)
        word, path = self._top.settings.on_resume
        if top.phase in ('', ENDED) or word == RESTART:
            self._store.end_trial(last.number, time.time(),
                                  top.label if top.phase == ENDED else RESTARTED)
            return None
        return self._resumption(last, word == ASK)._replace(begins_at=path)

    def _resumption(self, trial: StoredTrial, asks: bool) -> Resumption:
        changes = []
        if trial.structure != self._structure.id:
            changes = differences(self._store.description(trial.structure),
                                  self._structure.description)
        moment = self._store.moments(trial.number)[-1]
        return Resumption(trial, read_tree(self._store, trial.number, CODECS), moment.number,
                          moment.seq, moment.at, asks or bool(changes), changes)

    def begin_trial(self, resumed: Optional[Resumption]) -> None:
        """Store the trial from now on, and set the tree to where it was where it is resumed."""
        top, settings = self._top, self._top.settings
        if resumed is not None:
            go_on(top, resumed)
        new = NewTrial(top.name, top.trial_id, (*self._structure,), time.time())
        self._writer = StoreWriter(self._store, new if resumed is None else resumed.trial.number,
                                   settings.checkpoint_wait_s, smach.logwarn)
        self._observer = Checkpointer(top, self._writer, CODECS,
                                      None if resumed is None else resumed.tree)
        top.events.observers.insert(0, self._observer)  # before who may hold the machine up

    def end(self, why: TrialEnd, outcome: str, at: float) -> None:
        """Store the last of the trial, and let go of the store."""
        if self._observer in self._top.events.observers:
            self._top.events.observers.remove(self._observer)
        self._observer.last_words()
        self._writer.close(None if why in _CAN_GO_ON else Ending(at, outcome))
        self._let_go()

    def _let_go(self) -> None:
        self._store.close()
        self._lock.release()


def open_store(top: TreeNode) -> Optional[TrialStore]:
    """Return the store that the settings name, None where they name none.

    :raises StoreError: where it cannot be opened, or another process holds the machine.
    """
    return TrialStore(top) if top.settings.checkpoint else None
