"""Commands that wait for the thread that carries them out: all that have come, in order, and never
too many.
"""

import threading
import time

from waiting import Once, waits

from smach_oracle.interfaces.manipulation.command_inbox import CommandInbox


def test_all_that_have_come_are_taken_in_order_with_the_times_at_which_they_came():
    inbox = CommandInbox()
    begun_s = time.monotonic()
    inbox.put('go')
    inbox.put('stop')
    ended_s = time.monotonic()
    found = inbox.take_all(0.0)
    assert [arrived.command for arrived in found] == ['go', 'stop']
    assert begun_s <= found[0].at_s <= found[1].at_s <= ended_s
    assert inbox.take_all(0.0) == []


def test_one_that_comes_while_somebody_waits_is_taken_at_once():
    inbox = CommandInbox()
    taker = threading.current_thread()
    putter = Once(lambda: waits(taker), lambda: inbox.put('go'))
    assert [arrived.command for arrived in inbox.take_all(30.0)] == ['go']
    putter.join()


def test_a_flood_costs_the_oldest():
    inbox = CommandInbox()
    for number in range(1000):
        inbox.put(number)
    assert [arrived.command for arrived in inbox.take_all(0.0)] == list(range(900, 1000))
