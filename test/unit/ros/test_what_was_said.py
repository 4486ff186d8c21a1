"""A warning that would repeat is said once, and a program that runs for weeks keeps few of them."""

from smach_oracle.ros.log import said_once
from smach_oracle.ros.log.said_once import SaidOnce


def test_what_has_one_cause_is_said_once():
    said = []
    say = SaidOnce(said.append)
    for number in range(3):
        say('the disk is full')
        say('at {} s: late'.format(number), 'late')
    assert said == ['the disk is full', 'at 0 s: late']


def test_texts_that_all_differ_are_not_all_kept():
    say = SaidOnce(lambda text: None)
    for number in range(10 * said_once.MOST):
        say('error {}'.format(number))
    assert len(say._said) <= said_once.MOST


def test_a_text_that_comes_between_others_is_said_rarely():
    said = []
    say = SaidOnce(said.append)
    for number in range(3 * said_once.MOST):
        say('error {}'.format(number))
        say('the disk is full')
    assert said.count('the disk is full') <= 4
