"""The places where a trial goes on whose program was stopped, in its containers and states."""

from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Protocol

from ..records.events import FailureKind
from .container_records import ContainerRecords
from .state_record import StateRecord

NOT_BEGUN = 'the program was stopped before it began'


class Unfinished(NamedTuple):
    """The progress of a state when the program was stopped, in place of an execution."""

    kind: FailureKind
    outcome: str
    text: str
    asks: str  # why a person is asked at once, '' where nobody is
    snapshot: Optional[Mapping[str, object]] = None  # userdata with which it began
    keeps: bool = False  # where nobody answers, the trial is kept


class EntryPort(Protocol):
    """The place where a container goes on whose program was stopped (`checkpoint.resuming`)."""

    @property
    def label(self) -> str:
        """The state in which it goes on."""

    def take_over_records(self) -> None:
        """Have the visits of the execution that was stopped."""

    def enter(self) -> None:
        """Have the userdata as it was, and the state in which it goes on as the current one."""


class _AskedOnce:
    """A question before the first state of any of some containers.

    `passes`: states that are entered before, once each, on the way to where it stood.
    """

    def __init__(self, why: str, passes: Iterable[StateRecord]) -> None:
        self.why = why
        self.passes: List[StateRecord] = list(passes)


class ResumedTrial:
    """What waits for the next execution of a container, or for the coming visit of a state.

    `checkpoint.resuming` writes it as a stored trial goes on. Each of it is taken once. A container
    above takes it back where the machine is sent elsewhere. In any other trial it is empty. A
    container is known by its records.
    """

    def __init__(self) -> None:
        self._entries: Dict[ContainerRecords, EntryPort] = {}
        self._outcomes: Dict[ContainerRecords, str] = {}
        self._asked: Dict[ContainerRecords, _AskedOnce] = {}
        self._unfinished: Dict[StateRecord, Unfinished] = {}
        self._questions: Dict[StateRecord, str] = {}

    # -- of a container

    def enter_at(self, records: ContainerRecords, entry: EntryPort) -> None:
        """Have the next execution of a container go on there."""
        self._entries[records] = entry

    def entry_of(self, records: ContainerRecords) -> Optional[EntryPort]:
        """Return where the next execution of a container goes on, None: it begins."""
        return self._entries.get(records)

    def take_entry(self, records: ContainerRecords) -> Optional[EntryPort]:
        """Return the same, once."""
        return self._entries.pop(records, None)

    def had_ended(self, records: ContainerRecords, outcome: str) -> None:
        """Have the next execution of a container be over: it was before the program stopped."""
        self._outcomes[records] = outcome

    def take_outcome(self, records: ContainerRecords) -> Optional[str]:
        """Return the outcome of one that was over, once, None for any other."""
        return self._outcomes.pop(records, None)

    def ask_before_next(
        self, containers: Iterable[ContainerRecords], why: str, passes: Iterable[StateRecord]
    ) -> None:
        """Have a person asked once, before the first state of any of some containers.

        `passes`: states that are entered before, once each, on the way to where it stood.
        """
        asked = _AskedOnce(why, passes)
        self._asked.update((records, asked) for records in containers)

    # -- of a state

    def go_on_with(self, record: StateRecord, unfinished: Unfinished) -> None:
        """Have this stand in place of the coming visit of a state."""
        self._unfinished[record] = unfinished

    def unfinished(self, record: StateRecord) -> Optional[Unfinished]:
        """Return what stands in place of the coming visit of a state, None for nothing."""
        return self._unfinished.get(record)

    def take_unfinished(
        self, records: ContainerRecords, record: StateRecord
    ) -> Optional[Unfinished]:
        """Return the same, once. It may be the question before any state of its container."""
        unfinished = self._unfinished.pop(record, None)
        if unfinished is None:
            return self.take_asked(records, record)
        if unfinished.snapshot is not None:
            record.snapshot = dict(unfinished.snapshot)
        return unfinished

    def take_asked(self, records: ContainerRecords, record: StateRecord) -> Optional[Unfinished]:
        """Return the question before any state of a container, once for all of its containers."""
        asked = self._asked.get(records)
        if asked is None or not asked.why:
            return None
        if record in asked.passes:
            asked.passes.remove(record)
            return None
        why, asked.why = asked.why, ''
        return Unfinished(FailureKind.INTERRUPTED, '', NOT_BEGUN, why, keeps=True)

    def reopen(self, record: StateRecord, question_id: str) -> None:
        """Have the next question about a state be the one that was open.

        `question_id`: '' where it gets a new one.
        """
        self._questions[record] = question_id

    def has_question(self, record: StateRecord) -> bool:
        """Whether a question about a state was open."""
        return record in self._questions

    def take_question(self, record: StateRecord) -> str:
        """Return the id of the question that is open again, once, or '' where it has none."""
        return self._questions.pop(record, '')

    # -- both

    def goes_on(self, records: ContainerRecords) -> bool:
        """Whether a container is to go on where it stood, or one of its states is."""
        return (
            records in self._entries
            or records in self._outcomes
            or any(record in self._unfinished for record in list(records.by_label.values()))
        )

    def forget(self, records: ContainerRecords) -> None:
        """Let a container begin from the start."""
        self._entries.pop(records, None)
        self._outcomes.pop(records, None)
        self._asked.pop(records, None)

    def forget_states(self, records: ContainerRecords) -> None:
        """Let the coming visits of its states be new ones."""
        for record in list(records.by_label.values()):
            self._unfinished.pop(record, None)
            self._questions.pop(record, None)
