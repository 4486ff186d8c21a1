"""An expert by script: the answers to the questions of a trial, one after the other. No ROS."""

import threading
from typing import Any, Callable, List, Mapping, NamedTuple, Optional, Union

from smach_oracle.oracle.asking.answer_rules import (
    AnswerChoices,
    addressed,
    check_answer,
    choices_of,
)
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert, Progress, Question
from smach_oracle.oracle.errors import AnswerError
from smach_oracle.oracle.settings.interfaces import InterfaceOffer

from .errors import ScriptError

BY = 'script'


class ScriptedAnswer(NamedTuple):
    """One reply of the script to a question. `goto` and the like make it."""

    answer: Optional[Answer]  # None: nobody answers
    about: str = ''  # the state, LABEL or PATH/LABEL, that the question must be about. '' means any
    done: Optional[Answer] = None  # what the interface hands over

    def __str__(self) -> str:
        about = ' (about {})'.format(self.about) if self.about else ''
        return _in_words(self.answer) + about


def _in_words(answer: Optional[Answer]) -> str:
    if answer is None:
        return 'no answer'
    return '{} {}'.format(answer.kind.name.lower(), answer.named()).rstrip()


def goto(state: str, *, about: str = '', why: str = '') -> ScriptedAnswer:
    """Send the machine to a state.

    :param state: LABEL or PATH/LABEL, the path relative to the top machine.
    :param about: the failed state, LABEL or PATH/LABEL, that is expected in the question.
    """
    return ScriptedAnswer(Answer(AnswerKind.GOTO, state=state, by=BY, why=why), about)


def supersede(
    outcome: str, *, outputs: Optional[Mapping[str, Any]] = None, about: str = '', why: str = ''
) -> ScriptedAnswer:
    """End the failed state with this outcome, as if it had done its work.

    :param outputs: by the failed state's own key names.
    :param about: the failed state, LABEL or PATH/LABEL, that is expected in the question.
    """
    return ScriptedAnswer(
        Answer(AnswerKind.SUPERSEDE, outcome=outcome, outputs=outputs, by=BY, why=why), about
    )


def give_up(
    outcome: str = '', *, container: str = '', about: str = '', why: str = ''
) -> ScriptedAnswer:
    """End the container with this outcome. '' means as the failure would have ended it.

    :param container: a level above that ends so, LABEL or PATH/LABEL, or the name of the top
        machine. '' means the failed state's own. A level above needs an outcome.
    :param about: the failed state, LABEL or PATH/LABEL, that is expected in the question.
    """
    return ScriptedAnswer(
        Answer(AnswerKind.GIVE_UP, outcome=outcome, container=container, by=BY, why=why), about
    )


def use_interface(
    interface: str, outcome: str, *, outputs: Optional[Mapping[str, Any]] = None, about: str = ''
) -> ScriptedAnswer:
    """Choose an interface on offer, which then supersedes the failed state with this outcome.

    :param outputs: by the failed state's own key names.
    :param about: the failed state, LABEL or PATH/LABEL, that is expected in the question.
    """
    done = Answer(AnswerKind.SUPERSEDE, outcome=outcome, outputs=outputs, by=BY)
    return ScriptedAnswer(Answer(AnswerKind.INTERFACE, interface=interface, by=BY), about, done)


def no_answer(*, about: str = '') -> ScriptedAnswer:
    """Let the deadline of the question pass, without the wait.

    :param about: the failed state, LABEL or PATH/LABEL, that is expected in the question.
    """
    return ScriptedAnswer(None, about)


Said = Union[ScriptedAnswer, Answer, None]
Reply = Union[Said, Callable[[Question], Said]]


class AnswerScript(Expert):
    """Answers one question after another. `expert` makes it.

    A question that is not expected, and an answer that does not fit, are noted in `problem`, and
    the question has no answer. `check` then raises.
    """

    def __init__(self, replies: List[Reply], repeats: bool = False) -> None:
        """`repeats`: the last reply goes for all questions that follow."""
        self._replies = list(replies)
        self._repeats = repeats
        self._lock = threading.Lock()
        self._used = 0
        self._chosen: Optional[ScriptedAnswer] = None
        self.problem = ''  # the first one

    def begin(self) -> None:
        """Begin at the first reply, for a new trial."""
        with self._lock:
            self._used, self.problem, self._chosen = 0, '', None

    @property
    def left(self) -> int:
        """Return the number of replies that no question has used."""
        return 0 if self._repeats else len(self._replies) - self._used

    def check(self, shown: object = '') -> None:
        """Do nothing where every question went with the script. `shown` is added to the error.

        :raises ScriptError: with the question and the script.
        """
        __tracebackhide__ = True
        if self.problem:
            raise ScriptError('{}\n{}'.format(self.problem, shown).rstrip())

    def ask(
        self, question: Question, cancelled: threading.Event, progress: Progress
    ) -> Optional[Answer]:
        """Return the next answer of the script, None where there is none."""
        try:
            said = self._said(question)
            self._chosen = said
            if said.answer is None:
                return None
            choices = choices_of(question)
            answer = addressed(_placed(said.answer, choices), choices)
            check_answer(answer, choices)
            return answer
        except AnswerError as err:
            self._note('the answer of the script does not fit {}: {}'.format(_about(question), err))
        except ScriptError as err:
            self._note(str(err))
        except Exception as err:  # of the user's function
            self._note(
                'the script failed at {}: {}: {}'.format(_about(question), type(err).__name__, err)
            )
        return None

    def run_interface(
        self,
        offer: InterfaceOffer,
        question: Question,
        cancelled: threading.Event,
        progress: Progress,
    ) -> Optional[Answer]:
        """Hand over what the script says."""
        return None if self._chosen is None else self._chosen.done

    def _said(self, question: Question) -> ScriptedAnswer:
        with self._lock:
            if self._used >= len(self._replies) and not self._repeats:
                raise ScriptError(
                    'a question that the script does not expect: {}; {}'.format(
                        _about(question), self._in_words()
                    )
                )
            reply = self._replies[min(self._used, len(self._replies) - 1)]
            self._used += 1
        if not isinstance(reply, (ScriptedAnswer, Answer)) and callable(reply):
            reply = reply(question)
        said = _as_scripted(reply)
        if said.about not in ('', question.failed_state) and not _path(question).endswith(
            '/' + said.about
        ):
            raise ScriptError(
                'the script expects a question about {}, and this is {}; {}'.format(
                    said.about, _about(question), self._in_words()
                )
            )
        return said

    def _in_words(self) -> str:
        replies = [
            str(_as_scripted(reply)) if not callable(reply) else 'a function'
            for reply in self._replies
        ]
        return 'the script has {}'.format(', '.join(replies) or 'no answers')

    def _note(self, problem: str) -> None:
        with self._lock:
            self.problem = self.problem or problem


def _as_scripted(reply: object) -> ScriptedAnswer:
    if reply is None:
        return no_answer()
    if isinstance(reply, Answer):
        return ScriptedAnswer(reply)
    if isinstance(reply, ScriptedAnswer):
        return reply
    raise ScriptError(
        '{!r} is not an answer; give goto, supersede, give_up, use_interface or no_answer'.format(
            reply
        )
    )


def _placed(answer: Answer, choices: AnswerChoices) -> Answer:
    """Return an answer with the whole path of the container that it names."""
    if answer.kind is AnswerKind.GIVE_UP and answer.container:
        level = _level(answer.container, choices)
        return answer._replace(container='' if level == choices.container else level)
    if answer.kind is not AnswerKind.GOTO or answer.container or '/' not in str(answer.state):
        return answer
    top = choices.container.split('/')[0]
    paths = (answer.state, '{}/{}'.format(top, answer.state))
    for container, label in choices.states:
        if '{}/{}'.format(container or choices.container, label) in paths:
            return answer._replace(container=container, state=label)
    return answer


def _level(name: str, choices: AnswerChoices) -> str:
    """Return the path of the level of that LABEL or PATH/LABEL, the innermost of several."""
    levels = [choices.container, *(path for path, _ in choices.give_up_above)]
    found = [path for path in levels if name in (path, path.partition('/')[2])]
    found = found or [path for path in levels if path.endswith('/' + name)]
    return found[0] if found else name


def _path(question: Question) -> str:
    return '{}/{}'.format(question.container_path, question.failed_state)


def _about(question: Question) -> str:
    what = question.outcome or question.failure_kind.name.lower()
    return 'the question about {} ({}; {})'.format(_path(question), what, question.reason)


def expert(*replies: Union[Reply, List[Reply]]) -> AnswerScript:
    """Make an expert who gives these replies, one for each question of a trial.

    A reply is `goto`, `supersede`, `give_up`, `use_interface`, `no_answer`, or a function from the
    question to one of them. A single function answers all questions. A question more than there are
    replies is an error of the test, which the trial raises.

    >>> from smach_oracle.testing import expert, goto, no_answer
    >>> script = expert(goto('LOOK', about='PICK'), no_answer())
    >>> script.left
    2

    :raises ScriptError: for what is no reply.
    """
    given: List[Reply] = []
    for reply in replies:
        given.extend(reply if isinstance(reply, list) else [reply])
    for reply in given:
        if isinstance(reply, Answer) or not callable(reply):
            _as_scripted(reply)
    single = len(replies) == 1 and callable(replies[0])
    return AnswerScript(given, repeats=single)
