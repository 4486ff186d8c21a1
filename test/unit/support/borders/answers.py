"""Border of the expert's port: answers with anything in them."""

import threading
from typing import Any, Callable, List, Optional
from unittest import mock

from hypothesis import strategies as st
from prompt_toolkit.document import Document
from prompt_toolkit.validation import ValidationError

import smach
from smach_oracle.expert.terminal.prompts import JsonValidator
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert, Question

from .border import TAKEN, Border, refused
from .json_texts import json_texts
from .values import plain, texts, words

_given = st.one_of(
    plain,
    st.builds(
        Answer,
        st.one_of(st.sampled_from(list(AnswerKind)), st.integers(0, 9), plain),
        st.one_of(words('A', 'B'), plain),
        st.one_of(words('done', 'aborted'), plain),
        st.one_of(texts, plain),
        st.one_of(st.none(), st.dictionaries(words('cups'), plain, max_size=2), plain),
        st.one_of(words('eva'), plain),
        texts,
        st.one_of(words('', 'task'), plain),
    ),
)


class _Gives(Expert):
    """Gives what was drawn first, and gives up then."""

    def __init__(self, given: Any) -> None:
        self.given: List[Any] = [given]

    def ask(
        self, question: Question, cancelled: threading.Event, progress: Any
    ) -> Optional[Answer]:
        return self.given.pop() if self.given else Answer(AnswerKind.GIVE_UP, by='eva')

    def run_interface(self, *_: Any) -> Optional[Answer]:
        return None


def _fails_once() -> Callable[[Any], str]:
    left = ['aborted']
    return lambda userdata: left.pop() if left else 'done'


def _take_answer(given: Any) -> str:
    said: List[str] = []
    made = smach.StateMachine(outcomes=['done', 'aborted'])
    with made:
        smach.StateMachine.add(
            'A',
            smach.CBState(_fails_once(), outcomes=['done', 'aborted'], output_keys=['cups']),
            {'done': 'B'},
        )
        smach.StateMachine.add('B', smach.CBState(lambda _: 'done', outcomes=['done']))
    expert = _Gives(given)
    with mock.patch.object(smach, 'logwarn', said.append):
        machine = OracleContainer.wrap(
            made, name='task', expert=expert, settings={'policy': 'always_ask'}
        )
        assert machine.execute() in ('done', 'aborted')
    assert not expert.given, 'it was asked'
    unfit = [text for text in said if 'does not fit' in text or 'port failed' in text]
    return refused(unfit[0]) if unfit else TAKEN


def _take_json(text: str) -> str:
    """What a person types for an output, as the terminal sends it."""
    try:
        JsonValidator().validate(Document(text))
    except ValidationError as err:
        return refused(err.message)
    return TAKEN


BORDERS = [
    Border('answer of an expert', _given, _take_answer),
    Border('JSON typed in the terminal', json_texts, _take_json),
]
