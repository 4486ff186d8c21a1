"""The conversation while an interface runs that the expert has chosen."""

from test_terminal import talk
from typist import ENTER


def test_an_interface_is_chosen_its_output_shown_and_it_is_finished():
    front_end, interface, shown = talk(
        ['i1', '', 'o', 'f9', 'f²', 'f1', 'too early', 'f1', 'in the hand', 'q', '']
    )
    assert front_end.decisions[0].interface == interface.name == 'assist'
    assert interface.done == [('finish', 'succeeded', 'in the hand'), 'stopped']
    for part in (
        '| Now do the work of PICK',
        "'f9' is not one of f1",
        "'f²' is not one of f1",
        'Refused: the gripper is empty',
        'The interface has ended.',
        'DETECT runs.',
    ):
        assert part in shown


def test_an_interface_is_given_up():
    _, interface, _ = talk(['i1', '', 'g', 'out of reach', 'q', ''])
    assert interface.done == [('give up', 'out of reach'), 'stopped']


def test_an_interface_that_ends_by_itself_ends_the_conversation_with_what_it_said_last():
    def end(front_end):
        front_end.running = None

    ended = 'The interface has ended.'
    _, interface, shown = talk(
        ['i1', '', ''], (lambda front_end: front_end.seen_running, end), (ended, 'q' + ENTER)
    )
    assert interface.done == ['stopped']
    assert 'Now do the work of PICK' in shown and ended in shown
