#!/usr/bin/env python3
"""Scripts of many kinds, each as a process: bare, wrapped by a line of their own, under oracle_run.

A program is a kind of script and its ending. Where nothing fails, all three say the same, to the
last transition. Where something fails, the oracle helps; where it cannot, all three end alike.
"""

import re
import signal
import sys
import unittest
from typing import Callable, List

import rospy
from program_runs import BARE, LIBRARY, ORACLE_RUN, Ending, Programs

# by rostest, so that none of them takes long
KINDS = {
    'built': (
        'star_import',
        'self_building',
        'nested_functions',
        'imported_machine',
        'relay',
        'never_executed',
    ),
    'nested': (
        'callbacks',
        'top_concurrence',
        'top_iterator',
        'no_node',
        'again_and_again',
        'one_after_the_other',
    ),
    'served': ('action_server', 'actions', 'services', 'viewed', 'arguments'),
    'threads': ('in_threads', 'in_a_timer', 'shutdown_hooks', 'preempt_handler', 'no_machine'),
}
SILENT = ('never_executed', 'no_machine')  # no machine runs, so that an oracle has nothing to do
UNORDERED = ('in_threads',)
# by Ctrl-C: under oracle_run, a process that takes long to end is ended, with this code
BY_SIGNAL = 'preempt_handler'
FORCED = 128 + signal.SIGINT
# `always` is more than one visit here, also without an oracle
REPEATED = ('again_and_again', 'action_server')
ORDERLY = ('well', 'preempted')
FAILING = ('fails', 'raises')
WRAPPED = (LIBRARY, ORACLE_RUN)
# where the oracle cannot help, one way for each failure: which cannot matter
HELPLESS_WAY = {'fails': ORACLE_RUN, 'raises': LIBRARY}


def smooth(said: List[str]) -> List[str]:
    """What a program has said, without its failure and the oracle's way back.

    The way back is the next transition of the same machine: others may speak in between.
    """
    lines, at_oracle = [], set()
    for line in said:
        machine = re.split(' (?:is|ends) in ', line)[0]
        if line.endswith(' ORACLE'):
            at_oracle.add(machine)
        elif machine in at_oracle:
            at_oracle.remove(machine)
        elif 'does not succeed' not in line:
            lines.append(line)
    return list(dict.fromkeys(lines))


class ProgramsTest(unittest.TestCase):
    kinds = ()

    @classmethod
    def setUpClass(cls) -> None:
        cls.programs = Programs()
        cls.addClassCleanup(cls.programs.close)
        for kind in cls.kinds:
            for how in ORDERLY + FAILING:
                for way in (BARE,) + WRAPPED:
                    cls.programs.begin(way, kind, how)
            for how in FAILING if kind not in SILENT else ():
                cls.programs.begin(HELPLESS_WAY[how], kind, 'always ' + how, 'helpless')

    def ending(self, *run: str) -> Ending:
        ending = self.programs.ending(*run)
        self.assertIsNotNone(ending.code, 'it hangs: {}\n{}'.format(ending.said, ending.output))
        return ending

    def check(self, kind: str, how: str) -> None:
        bare = self.ending(BARE, kind, how)
        self.assertTrue(bare.said, bare.output)
        for way in WRAPPED:
            ending = self.ending(way, kind, how)
            if how in ORDERLY or kind in SILENT:
                self.check_same(kind, ending, bare)
            else:
                self.check_recovered(kind, ending, bare)
        if how in FAILING and kind not in SILENT:
            self.check_given_up(kind, how)

    def check_same(self, kind: str, ending: Ending, bare: Ending) -> None:
        said, expected = ending.said, bare.said
        if kind == BY_SIGNAL and ending.code == FORCED:
            self.assertEqual(said, expected[: len(said)])
            return
        if kind in UNORDERED:
            said, expected = sorted(said), sorted(expected)
        self.assertEqual(said, expected, ending.output)
        self.assertEqual(ending.end(), bare.end(), ending.output)

    def check_recovered(self, kind: str, ending: Ending, bare: Ending) -> None:
        """It ends as if nothing had failed; bare it does not."""
        good = self.ending(BARE, kind, 'well')
        self.assertNotEqual(bare.end(), good.end())
        self.assertEqual(ending.end(), good.end(), ending.output)
        said, expected = smooth(ending.said), smooth(good.said)
        if kind in UNORDERED:
            said, expected = sorted(said), sorted(expected)
        self.assertEqual(said, expected, ending.output)
        self.assertIn('does not succeed', '\n'.join(ending.said))

    def check_given_up(self, kind: str, how: str) -> None:
        always = 'always ' + how
        bare = self.ending(BARE, kind, always if kind in REPEATED else how)
        ending = self.ending(HELPLESS_WAY[how], kind, always, 'helpless')
        self.assertEqual(ending.end(), bare.end(), '\n'.join(ending.said) + ending.output)


def make_test(kind: str, how: str) -> Callable[[ProgramsTest], None]:
    """The test of one program."""
    return lambda self: self.check(kind, how)


def tests_of(kinds: tuple) -> type:
    """A case for each program of these kinds."""
    tests = {
        'test_{}_{}'.format(kind, how): make_test(kind, how)
        for kind in kinds
        for how in ORDERLY + FAILING
    }
    return type('ProgramsTest', (ProgramsTest,), dict(tests, kinds=kinds))


if __name__ == '__main__':
    import rostest

    group = sys.argv[1]
    rospy.init_node('oracle_programs')
    rostest.rosrun(
        'smach_oracle',
        'oracle_programs_' + group,
        tests_of(KINDS[group]),
        sys.argv[:1] + sys.argv[2:],
    )
