"""An answer and the question that it fits: whose state it names, and what is wrong with another."""

import pytest
from machines import give_up, goto, interface, supersede

from smach_oracle.oracle.asking.answer_rules import (
    AnswerChoices,
    addressed,
    check_answer,
    check_output_keys,
    checked_type,
)
from smach_oracle.oracle.asking.question import Answer
from smach_oracle.oracle.errors import AnswerError

# LEFT, a branch of BOTH, has failed. TWICE is in two other containers
CHOICES = AnswerChoices(
    'TOP/BOTH',
    'LEFT',
    {
        ('', 'LEFT'): '',
        ('TOP/BOTH', 'RIGHT'): '',
        ('TOP', 'A'): '',
        ('TOP', 'B'): 'still runs',
        ('TOP', 'TWICE'): '',
        ('TOP/IN', 'TWICE'): '',
        ('TOP/IN', 'LEFT'): '',
    },
    ['ok', 'lost'],
    ['done'],
    ['hand'],
    ['cup', 'pose'],
    [('TOP', 'aborted')],
)


@pytest.mark.parametrize(
    'answer, container',
    [
        (goto('LEFT'), ''),
        (goto('LEFT', container='TOP/BOTH'), ''),
        (goto('RIGHT', container='TOP/BOTH'), 'TOP/BOTH'),
        (goto('RIGHT'), 'TOP/BOTH'),
        (goto('A'), 'TOP'),
        (goto('A', container='TOP/IN'), 'TOP/IN'),
        (goto('TWICE'), ''),
        (goto('TWICE', container='TOP/IN'), 'TOP/IN'),
        (supersede('ok', state='A'), ''),
        (give_up('done', container='TOP/BOTH'), ''),
        (give_up('aborted', container='TOP'), 'TOP'),
    ],
)
def test_a_state_that_one_container_has_is_that_ones(answer, container):
    assert addressed(answer, CHOICES) == answer._replace(container=container)


@pytest.mark.parametrize(
    'answer, why',
    [
        (goto('A'), "TOP/BOTH has no state 'A' to go to; allowed: LEFT; it is in TOP: name the "),
        (goto('C'), "TOP/BOTH has no state 'C' to go to; allowed: LEFT$"),
        (goto('C', container='TOP'), "TOP has no state 'C' to go to; allowed: A, TWICE$"),
        (goto('B', container='TOP'), 'B cannot be entered now: still runs; allowed: A, TWICE$'),
        (supersede('odd'), "LEFT has no outcome 'odd' to supersede it with; allowed: lost, ok$"),
        (give_up('odd'), "TOP/BOTH has no outcome 'odd' .* with; allowed: done, or none at all$"),
        (give_up('odd', container='TOP'), "TOP has no outcome 'odd' .* with; allowed: aborted$"),
        (give_up('', container='TOP'), "TOP has no outcome '' to give up with; allowed: aborted$"),
        (interface('arm'), "no interface 'arm' is on offer for LEFT; allowed: hand$"),
        (supersede('ok', outputs={'mug': 1}), 'LEFT has no output keys mug; allowed: cup, pose$'),
    ],
)
def test_an_answer_that_does_not_fit_is_told_what_would(answer, why):
    with pytest.raises(AnswerError, match='^' + why):
        check_answer(answer, CHOICES)


@pytest.mark.parametrize(
    'answer',
    [
        goto('LEFT'),
        goto('A', container='TOP'),
        supersede('lost', outputs={'cup': 1}),
        give_up(),
        give_up('done'),
        give_up('aborted', container='TOP'),
        interface('hand'),
    ],
)
def test_an_answer_that_fits_is_taken(answer):
    assert checked_type(answer) is answer
    check_answer(answer, CHOICES)


@pytest.mark.parametrize(
    'given, why',
    [
        ('A', 'it is of type str, not an Answer'),
        (Answer('goto'), 'kind is of type str, not an AnswerKind'),
        (goto(['A']), 'state is of type list, not a name'),
        (supersede({}), 'outcome is of type dict, not a name'),
        (interface([]), 'interface is of type list, not a name'),
        (goto('A')._replace(by=3), 'by is of type int, not text'),
        (goto('A', why=None), 'why is of type NoneType, not text'),
        (goto('A', container=b'TOP'), 'container is of type bytes, not text'),
        (supersede('ok', outputs=['cup']), 'outputs is of type list, not a mapping'),
    ],
)
def test_a_field_of_another_type_is_named(given, why):
    with pytest.raises(AnswerError, match='^{}$'.format(why)):
        checked_type(given)


def test_output_keys_that_come_twice_are_named():
    check_output_keys('LEFT', ['cup', 'pose'], ['cup', 'pose'])
    with pytest.raises(AnswerError, match='^output keys come twice: cup$'):
        check_output_keys('LEFT', ['cup', 'pose', 'cup'], ['cup', 'pose'])


def test_where_nothing_is_allowed_the_refusal_says_so():
    with pytest.raises(AnswerError, match=r'no interface .* for LEFT; allowed: \(none\)$'):
        check_answer(interface('hand'), CHOICES._replace(interfaces=()))
