"""Questions of the oracle, and answers to them (paper, section V). No ROS, no smach."""

import threading
import warnings
from enum import IntEnum
from typing import Callable, Iterable, Mapping, NamedTuple, Optional, Tuple

from ..records.events import FailureKind
from ..records.visits import Visit
from ..settings.interfaces import InterfaceOffer


class AnswerKind(IntEnum):
    """The kinds of decision of an expert. The numbers are those of ExpertDecision.msg."""

    GOTO = 1
    SUPERSEDE = 2
    GIVE_UP = 3
    INTERFACE = 4


class StateChoice(NamedTuple):
    """A state that the expert may send the machine to."""

    state: str
    predicted_success: float  # 1 - learned failure rate
    failure_class: int
    visits: int  # in this trial
    missing_keys: Tuple[str, ...]  # input keys that would be missing after the jump
    preconditions: Tuple[str, ...]  # names, in the order in which they run
    blocked: str = ''  # why it cannot be entered now, '' where it can
    # states done in this trial that would come again behind it, though they are not repeated by
    # themselves. Its own label: going there repeats it
    repeats: Tuple[str, ...] = ()
    container: str = ''  # path of its container. '' means that of the failed state
    # of a Concurrence, and of what lies in one that is entered for it: the labels of its branches,
    # which all run again
    runs_again: Tuple[str, ...] = ()
    # of the way of the menu that leads there (`Way`). '', 0: no way of the menu does
    way: str = ''  # its key
    minutes: float = 0.0  # that the robot is expected to take until it is where it was
    # of going there after such a failure of the failed state. 0, 0, 0: nothing is known
    helped: int = 0  # times that the failed state succeeded next
    tried: int = 0  # of so many
    helped_s: float = 0.0  # mean time until it did
    recommended: str = ''  # why this choice is recommended, '' where it is not


class OutcomeChoice(NamedTuple):
    """An outcome with which the failed state may be superseded, and where it leads."""

    outcome: str
    target: str  # a state or a container outcome, of a branch: words for people


class LevelOutcome(NamedTuple):
    """An outcome with which a container above that of the failed state may be given up."""

    container: str  # path
    outcome: str


class PreconditionStatus(NamedTuple):
    """The status of a precondition: whether it holds, and why."""

    holds: Optional[bool]  # None: it cannot be told
    text: str  # why, for people


class PreconditionProbe:
    """Finds out how the preconditions of a question's choices stand. The oracle implements it."""

    names: Tuple[Tuple[str, str], ...] = ()  # state and precondition of each

    def status(self, number: int) -> PreconditionStatus:
        """Return how the precondition of that number stands.

        It may call a user's function, and so take forever.
        """
        raise NotImplementedError


class Question(NamedTuple):
    """A question to the expert, with everything that the expert is shown.

    The fields are those of the ExpertQuery goal, where `question_id` is called `query_id`.
    """

    question_id: str
    trial_id: str
    container_path: str
    failed_state: str
    failure_kind: FailureKind
    outcome: str
    text: str
    failure_class: int
    rate: float
    continuous: bool
    recoveries: int
    reason: str
    tried: Tuple[str, ...]
    history: Tuple[Visit, ...]  # oldest first, bounded
    choices: Tuple[StateChoice, ...]
    supersede_outcomes: Tuple[OutcomeChoice, ...]
    output_keys: Tuple[str, ...]  # of the failed state, its own names
    give_up_outcomes: Tuple[str, ...]
    interfaces: Tuple[InterfaceOffer, ...]
    userdata: Mapping[str, object]  # the container's, values as they are
    # the failed state's inputs, by its own key names, where present
    input_userdata: Mapping[str, object]
    deadline_s: float  # 0: waits without end
    fallback: str  # what happens at the deadline, in words
    # how those of the choices stand, as long as it is open. None means nobody can tell
    preconditions: Optional[PreconditionProbe] = None
    give_up_above: Tuple[LevelOutcome, ...] = ()  # innermost level first

    @property
    def query_id(self) -> str:
        """Return `question_id`, by the name that it had before."""
        warnings.warn('Question.query_id is now called question_id', FutureWarning, stacklevel=2)
        return self.question_id


class Answer(NamedTuple):
    """The decision of an expert."""

    kind: AnswerKind
    state: str = ''  # GOTO
    # SUPERSEDE, GIVE_UP ('' there: as the failure would have ended the container)
    outcome: str = ''
    interface: str = ''  # INTERFACE
    outputs: Optional[Mapping[str, object]] = None  # by the failed state's own key names
    by: str = ''
    why: str = ''
    # GOTO, GIVE_UP: path of the container of `state`, or of the one that ends with `outcome`; '':
    # that of the failed state
    container: str = ''

    def named(self) -> str:
        """Return the state, interface or outcome that it names.

        A name in another container than the failed state's has its path in front.
        """
        name = {AnswerKind.GOTO: self.state, AnswerKind.INTERFACE: self.interface}.get(
            self.kind, self.outcome
        )
        return '{}/{}'.format(self.container, name) if self.container else name


# Told while a question is open: ('claimed', by, text), ('released', by, text), ('interface_start',
# interface, text), ('interface_end', interface, outcome).
Progress = Callable[[str, str, str], None]


class Expert:
    """The port through which a machine asks. Derive from it to answer questions yourself.

    ros/ implements it with the ExpertQuery action. Tests implement it in a few lines.

    >>> import smach
    >>> from smach_oracle.oracle import Answer, AnswerKind, Expert, OracleContainer
    >>> class Supervisor(Expert):
    ...     def ask(self, question, cancelled, progress):
    ...         print(question.failed_state, 'ended in', question.outcome)
    ...         return Answer(AnswerKind.GOTO, state='PICK', by='supervisor')
    >>> results = iter(['aborted', 'succeeded'])
    >>> pick = smach.CBState(lambda userdata: next(results), outcomes=['succeeded', 'aborted'])
    >>> sm = smach.StateMachine(['succeeded', 'aborted'])
    >>> with sm:
    ...     _ = smach.StateMachine.add('PICK', pick)
    >>> OracleContainer.wrap(
    ...     sm, settings={'policy': 'always_ask'}, expert=Supervisor()
    ... ).execute()
    PICK ended in aborted
    'succeeded'
    """

    def ask(
        self, question: Question, cancelled: threading.Event, progress: Progress
    ) -> Optional[Answer]:
        """Return the answer, or None where nobody answered by the deadline or `cancelled` was set.

        It is called in its own thread. It must return soon (tens of milliseconds) after `cancelled`
        is set. A second later it is abandoned, and its answer is dropped. An
        INTERFACE answer is handed back as it is. `run_interface` is then called. Deadlines are
        monotonic wall time. May raise AnswerError for an answer that cannot be used. The question
        is then put again.
        """
        raise NotImplementedError

    def run_interface(
        self,
        offer: InterfaceOffer,
        question: Question,
        cancelled: threading.Event,
        progress: Progress,
    ) -> Optional[Answer]:
        """Run a shared-autonomy interface.

        It is called, and left behind, as `ask` is. It returns a SUPERSEDE answer, or None where the
        interface failed or was cancelled.

        May raise InterfaceError, which says to the expert why the interface cannot be used.
        """
        return None


def names(items: Iterable[object]) -> str:
    """Return a list for an error text. Outcomes and labels need not be strings."""
    return ', '.join(sorted(map(str, items))) or '(none)'
