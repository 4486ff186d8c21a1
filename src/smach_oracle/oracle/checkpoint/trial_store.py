"""The store of one trial: opened before it begins, held while it runs."""

import contextlib
import os
import sqlite3
import time
from typing import Iterator, List, Optional, Set, Tuple

import smach
from smach_oracle.store.errors import StoreDamaged, StoreError
from smach_oracle.store.holding import MachineLock
from smach_oracle.store.names import BEFORE, BROKEN, ENDED, GOAL, KEPT, RENAMED, STRUCTURE
from smach_oracle.store.rows import Fact, NewMoment, StoredMoment, StoredTrial, is_in_doubt
from smach_oracle.store.store_file import NewTrial, StoreFile
from smach_oracle.store.store_writer import Ending, StoreWriter

from ..errors import CheckpointError, OracleError, SettingsError
from ..identity import remove_identical
from ..machine.items import can_be_indexed
from ..machine.nesting import branching_below, nodes_of
from ..machine.tree import new_id, no_store
from ..machine.tree_node import TreeNode
from ..records.events import EventKind
from ..records.facts import TrialEnd
from ..records.running_goals import GOALS
from ..settings.checks import ASK, RECOVER, RESTART, STATE
from ..settings.failing_outcomes import name_text
from ..settings.failure_rule import FORMER_RULE, RULE, rule_in
from ..settings.settings import GROUPS
from .checkpointer import Checkpointer
from .container_facts import fact_of
from .resuming import PAUSED, Resumption, go_on
from .stored_marks import marks_now, same_place
from .stored_tree import StoredTree, read_tree
from .structure import changed_script, structure_of


@contextlib.contextmanager
def understood(path: str) -> Iterator[None]:
    """Have what the facts of a store drive the body to raise be the damage of the store at `path`.

    :raises StoreDamaged: in place of it.
    """
    try:
        yield
    except OracleError:
        raise
    except StoreError as err:
        if path in str(err):
            raise
        raise StoreDamaged('{}: {}'.format(path, err)) from err
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as err:
        raise StoreDamaged(
            '{0}: is damaged, and its trial cannot go on: {1!r}. `oracle_state {0} '
            'drop` ends the trial, and a new one can begin'.format(path, err)
        ) from err


# what may be resumed: the program was stopped, and the task was not done
_CAN_GO_ON = (TrialEnd.STOPPED, TrialEnd.SHUTDOWN, TrialEnd.KEPT)
_used: Set[Tuple[str, int]] = set()  # stores and moments of them that this program has gone on from
BEGINS_ANEW = '{}: the stored trial of {} is over, and a new one begins: {}'
NO_ORACLE = (
    '{}: the trial of {} was stopped, and only an oracle can find out how it goes on '
    '(recover=False, --without-oracle). Execute it with an oracle. Or say how without one: '
    'on_resume is state:LABEL or restart, or `oracle_state` drops the trial. It is kept until then'
)
NOT_STORED = (
    '{}: {} was not written any more after a fault of the store, so other states may '
    'have run since then. A person is asked before anything moves'
)
RESTARTED = 'restarted'  # in place of the outcome of a trial that was given up for a new one


class TrialStore:
    """The traces that one trial leaves in the store that the settings name."""

    _goes_on_from: Optional[Tuple[str, int]] = None  # an earlier moment, and its store
    _writer: Optional[StoreWriter] = None
    _observer: Optional[Checkpointer] = None

    def __init__(self, top: TreeNode) -> None:
        """Hold the machine in the store.

        :raises StoreError: where the store cannot be opened, or another process holds the machine.
        """
        settings = top.settings
        self._top = top
        meta = settings.oracle_label if top.tree.recover else ''
        self._structure = structure_of(top.machine, meta)
        self._lock = MachineLock(settings.checkpoint, top.name)
        self._lock.take()
        try:
            self._store = StoreFile(settings.checkpoint, settings.checkpoint_synchronous)
        except BaseException:
            self._lock.release()
            raise

    def to_resume(self) -> Optional[Resumption]:
        """Return the trial that goes on, None where a new one begins.

        :raises CheckpointError: where the store cannot be read or written.
        :raises SettingsError: for a moment to go on from that is none of the trial.
        """
        with self._or_let_go():
            return self._to_resume()

    def _to_resume(self) -> Optional[Resumption]:
        last = self._instead_of_lost(self._store.latest_trial(self._top.name))
        if last is None or last.ended is not None or not last.moments:
            self._earlier_moment(None)
            smach.loginfo(
                '{}: {} has no trial that was stopped: a new one begins'.format(
                    self._top.path, self._store.path
                )
            )
            return None
        tree = read_tree(self._store, last.number)
        top = tree.container(self._top.key)
        word, path = self._top.settings.on_resume
        earlier = self._earlier_moment(last)
        moments = self._store.moments(last.number)
        # before its first state nothing had run, but nothing is to move without being asked either
        is_over = (
            top.phase == ENDED
            or word == RESTART
            or not (top.phase or word == ASK or is_in_doubt(moments))
        )
        if not earlier and is_over:
            if top.phase != ENDED:
                smach.logwarn(
                    BEGINS_ANEW.format(
                        self._top.path,
                        self._store.path,
                        GROUPS.key_of('on_resume') + ' is restart'
                        if word == RESTART
                        else 'the last trial was stopped before its first state',
                    )
                )
            # in a program that has had a trial an operator may have ended it since
            if not self._top.tree.trials and self._top.tree.pause_as_stored(tree.whole):
                smach.logwarn(PAUSED.format(self._top.path))
            self._store.end_trial(
                last.number, time.time(), top.label if top.phase == ENDED else RESTARTED
            )
            return self._to_resume() if top.phase == ENDED else None
        is_clear = word == STATE or (word == RECOVER and top.phase == BEFORE)
        if not (self._top.tree.recover or is_clear):
            raise CheckpointError(NO_ORACLE.format(self._top.path, self._store.path))
        resumed = self._resumption(last, tree, moments, earlier)
        if resumed.script.names:
            self._store.keep_structure(self._structure)
        return resumed if earlier else resumed._replace(begins_at=path)

    def _instead_of_lost(self, last: Optional[StoredTrial]) -> Optional[StoredTrial]:
        """Return the last trial of the machine, a new one in doubt where it may be lost."""
        lost = self._store.lost_until()
        if (
            lost is None
            or self._top.settings.on_resume[0] == RESTART
            or (last is not None and last.number > lost)  # one that can go on is behind it
        ):
            return last
        now = time.time()
        number = self._store.begin_trial(
            NewTrial(self._top.name, new_id(), (*self._structure,), now)
        )
        self._store.add(number, [NewMoment(now, -1, BROKEN, self._top.key, '', ())])
        return self._store.latest_trial(self._top.name)

    def _earlier_moment(self, unfinished: Optional[StoredTrial]) -> int:
        """Return the number of the moment that the settings name, 0 for the last one.

        A program goes on from it once.

        :raises SettingsError: where it is none of the unfinished trial.
        """
        number = self._top.settings.resume_from
        used = (os.path.abspath(self._store.path), number)
        if not number or used in _used:
            return 0
        trial = self._store.trial_of(number)
        if trial is not None and trial.machine != self._top.name:
            return 0  # of another machine of the program
        if trial is None or unfinished is None or trial.number != unfinished.number:
            raise SettingsError(
                GROUPS.key_of('resume_from'),
                number,
                'a moment of the trial of {} that was stopped and has not ended'.format(
                    self._top.name
                ),
            )
        self._goes_on_from = used
        return number

    def _resumption(
        self, trial: StoredTrial, tree: StoredTree, moments: List[StoredMoment], earlier: int
    ) -> Resumption:
        """Return how a trial goes on. `tree`: what its last moment says."""
        in_doubt = is_in_doubt(moments)
        if in_doubt:
            smach.logwarn(NOT_STORED.format(self._top.path, self._store.path))
        latest = tree
        # what runs elsewhere, and what was asked, has not become undone
        kept = {
            name: value
            for name, value in tree.whole.items()
            if name.startswith(GOAL) or name in ('questions', 'paused')
        }
        if earlier:
            tree = read_tree(self._store, trial.number, earlier)
        names = self._top.settings.resume_map
        script = changed_script(names, self._store, trial, tree, self._structure)
        renaming = script.renaming
        if renaming is not None:
            tree = read_tree(self._store, trial.number, earlier or None, renaming)
        marks = marks_now(latest, tree, same_place if renaming is None else renaming.state)
        tree.whole.update(kept)
        return Resumption(
            trial,
            tree,
            earlier or moments[-1].number,
            max(each.seq for each in moments),
            moments[-1].at,
            self._top.settings.on_resume[0] == ASK
            or in_doubt
            or bool(script.changes and renaming is None),
            script,
            marks,
            is_in_doubt=in_doubt,
            is_earlier=bool(earlier),
            rule=rule_in(tree.whole) or (FORMER_RULE if tree.containers else None),
        )

    def begin_trial(self, resumed: Optional[Resumption]) -> None:
        """Store the trial from now on, and set the tree to where it was where it is resumed.

        :raises CheckpointError: where what the store holds cannot be understood.
        :raises SettingsError: where it is to go on in a state that is not there.
        """
        top, settings = self._top, self._top.settings
        _tell_what_begins_anew(top)
        if resumed is not None:
            with self._or_let_go():
                go_on(top, resumed)
        new = NewTrial(top.name, top.trial_id, (*self._structure,), time.time())
        writer = self._writer = StoreWriter(
            self._store,
            new if resumed is None else resumed.trial.number,
            settings.checkpoint_wait_s,
            smach.logwarn,
        )
        observer = self._observer = Checkpointer(
            top,
            writer,
            StoredTree({}, {}) if resumed is None else resumed.tree,
            resumed.moment if resumed and resumed.is_earlier else None,
            self._first_facts(resumed),
        )
        GOALS.observers.append(observer.goal_begins)
        top.tree.keep_marks = observer.keep_marks
        top.events.observers.insert(0, observer)  # before who may hold the machine up

    def _first_facts(self, resumed: Optional[Resumption]) -> List[Fact]:
        """Return what is stored of the whole trial as it begins, or goes on.

        One that goes on may do so by another rule of failures, and with other names of states.
        """
        rule = fact_of('', RULE, self._top.in_force.rule.as_data())
        if resumed is None or not resumed.script.names:
            return [rule]
        return [
            rule,
            fact_of('', STRUCTURE, self._structure.id),
            fact_of('', RENAMED, [resumed.script.before, dict(resumed.script.names)]),
        ]

    @contextlib.contextmanager
    def _or_let_go(self) -> Iterator[None]:
        """Let go of the store where the body cannot read it, or fails otherwise."""
        try:
            with understood(self._store.path):
                yield
        except (StoreError, sqlite3.Error) as err:
            self._let_go()
            raise _refused(err, self._top) from err
        except BaseException:
            self._let_go()
            raise

    @staticmethod
    def can_go_on(why: TrialEnd) -> bool:
        """Whether a trial that ended so may be resumed."""
        return why in _CAN_GO_ON

    def end(self, why: TrialEnd, outcome: str, at: float) -> None:
        """Store the last of the trial, and let go of the store."""
        if self._goes_on_from is not None:
            _used.add(self._goes_on_from)
        self._observe_no_more()
        if self._observer is not None:
            self._observer.last_words(KEPT if why is TrialEnd.KEPT else EventKind.TRIAL_END.name)
        self._close(None if self.can_go_on(why) else Ending(at, name_text(outcome)))

    def let_go(self) -> None:
        """Let go of the store, as its trial does not begin. What it holds can still go on."""
        self._observe_no_more()
        self._close(None)

    def _observe_no_more(self) -> None:
        observer = self._observer
        if observer is not None:
            remove_identical(self._top.events.observers, observer)
            with contextlib.suppress(ValueError):  # it may not have come so far
                GOALS.observers.remove(observer.goal_begins)
            self._top.tree.keep_marks = no_store

    def _close(self, ending: Optional[Ending]) -> None:
        try:
            if self._writer is not None:
                self._writer.close(ending)
        finally:
            self._let_go()

    def _let_go(self) -> None:
        self._store.close()
        self._lock.release()


def _tell_what_begins_anew(top: TreeNode) -> None:
    """Name the Iterators that would begin with their first item after a crash."""
    for node in nodes_of(top.machine):
        for below, container in branching_below(node.machine):
            if isinstance(container, smach.Iterator) and not can_be_indexed(container):
                smach.logwarn(
                    '{}/{}: begins again with its first item where the machine is '
                    'resumed, since its items are not a sequence'.format(node.path, '/'.join(below))
                )


def open_store(top: TreeNode) -> Optional[TrialStore]:
    """Return the store that the settings name, None where they name none.

    :raises CheckpointError: where it cannot be opened, or another process holds the machine.
    """
    try:
        return TrialStore(top) if top.settings.checkpoint else None
    except StoreError as err:
        raise _refused(err, top) from err


def _refused(err: Exception, top: TreeNode) -> CheckpointError:
    return CheckpointError(
        '{} does not begin, as its store cannot be used: {}'.format(top.path, err)
    )
