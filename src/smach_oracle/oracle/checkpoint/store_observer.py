"""Stores a trial while that can be done. Whatever fails in it stops no machine."""

import time
from functools import partial
from typing import Callable

import smach
from smach_common.foreign import ends_program, error_text
from smach_oracle.store.names import BROKEN
from smach_oracle.store.rows import NewMoment
from smach_oracle.store.store_writer import StoreWriter

from ..machine.tree_node import TreeNode
from ..records.events import Event
from .checkpointer import Checkpointer, must_stop

LOST = (
    '{0}: this trial is not stored any more, as a fault of the store kept it from being '
    'written: {1}. The machine goes on. If its program is stopped now, the next start asks a '
    'person before anything moves. Please report this fault'
)


class StoreObserver:
    """The observer that stores a trial, and is told of goals.

    A moment that is stored in part would lead to a wrong place. So after a fault nothing is stored
    but that there was one.
    """

    def __init__(self, top: TreeNode, writer: StoreWriter, checkpointer: Checkpointer) -> None:
        self._top, self._writer, self._checkpointer = top, writer, checkpointer
        self._is_broken = False

    def __call__(self, event: Event) -> None:
        """Take one event. See EventSource."""
        self._do(partial(self._checkpointer, event))

    def goal_begins(self, goal_id: str, server: str) -> None:
        """Store a goal that is about to be sent."""
        self._do(partial(self._checkpointer.goal_begins, goal_id, server))

    def keep_marks(self) -> None:
        """Store which states have begun. See Checkpointer."""
        self._do(self._checkpointer.keep_marks)

    def last_words(self, kind: str) -> None:
        """Store what has not been stored of the trial, which has ended, as a moment of a kind."""
        self._do(partial(self._checkpointer.last_words, kind))

    def _do(self, store: Callable[[], None]) -> None:
        if self._is_broken:
            return
        try:
            store()
        except BaseException as err:
            if ends_program(err):
                raise
            self._is_broken = True
            smach.logerr(LOST.format(self._writer.path, error_text(err)))
            top = self._top
            self._writer.commit(
                NewMoment(time.time(), top.events.last_seq, BROKEN, top.key, '', ()),
                lambda: must_stop(top),
            )
