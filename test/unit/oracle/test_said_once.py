"""Warnings that may come at each visit are said once in a trial; long texts keep head and tail."""

import threading

import pytest
from branch_machines import Item, inside, iterator_over
from machines import Scripted, Watched, chain_of

from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.short_text import shortened

KEYS = ['lock_{}'.format(index) for index in range(11)]


def test_keys_that_cannot_be_copied_are_named_once_in_a_trial(log):
    machine = chain_of(Scripted('ok', 'ok'), Scripted('aborted', 'aborted'), Scripted('aborted'))
    for key in KEYS:
        machine.userdata[key] = threading.Lock()
    watched = Watched(machine, settings={'deep_copy_keys': KEYS, 'memory': 1000})
    for trial in (1, 2):
        assert watched.run() == 'done'
        assert len(watched.of(EventKind.WARNING)) == trial * len(KEYS)
    said = [text for level, text in log if level == 'warn' and 'deep-copied' in text]
    assert len(said) == 2 * len(KEYS) and all('SM_ROOT' in text for text in said)


def test_an_iterator_s_items_name_such_a_key_once(log):
    machine = inside(iterator_over(Item()))
    machine['ALL'].userdata.lock = threading.Lock()
    watched = Watched(machine, settings={'deep_copy_keys': ['lock']})
    assert watched.run() == 'done'
    said = [text for level, text in log if level == 'warn' and 'deep-copied' in text]
    assert len(said) == len(set(said)) <= 2  # of the machine around the items and of each branch


@pytest.mark.parametrize('length, longest', [(0, 5), (5, 5), (6, 5), (1000, 300), (1001, 300)])
def test_a_text_keeps_its_head_and_its_tail(length, longest):
    text = ('ValueError: ' + 'x' * length)[: max(0, length - 3)] + 'end'[:length]
    short = shortened(text, longest)
    assert len(short) <= max(longest, 3)
    if length > longest > 10:
        assert short.startswith('ValueError: ') and short.endswith('end')
    if length <= longest:
        assert short == text
