"""Machines that are killed at a chosen point and begun again, each in a process of its own."""

import collections
import json
import os
import signal
import tempfile
import threading
import traceback

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.machine.nesting import records_of
from smach_oracle.oracle.records.events import EventKind


class Points:
    """Counts the points that a machine passes, and kills its process at one of them."""

    def __init__(self, kill_at, stop_at=()):
        """`stop_at`: where it stops until another process has it go on."""
        self._kill_at, self._stop_at = kill_at, stop_at
        self.passed = 0
        self._lock = threading.Lock()

    def __call__(self, *_):
        with self._lock:
            self.passed += 1
            if self.passed == self._kill_at:
                os.kill(os.getpid(), signal.SIGKILL)
            if self.passed in self._stop_at:  # this thread takes it, and all others stop with it
                signal.pthread_kill(threading.get_ident(), signal.SIGSTOP)


class Diary:
    """What the states of all processes have done, in a file."""

    def __init__(self, path):
        self._path = path

    def write(self, what, name):
        with open(self._path, 'a') as stream:
            stream.write('{} {}\n'.format(what, name))

    def count(self, what):
        """How often each state has done it."""
        if not os.path.exists(self._path):  # killed before any state has run
            return collections.Counter()
        with open(self._path) as stream:
            lines = [line.split(None, 1) for line in stream]
        return collections.Counter(name.strip() for found, name in lines if found == what)


class Noted(smach.State):
    """Appends its name to the userdata key `done`; fails the first `failures` times."""

    def __init__(self, name, diary, points, failures=0, keys=('done',)):
        smach.State.__init__(self, ['succeeded', 'aborted'], list(keys), ['done'])
        self._name, self._diary, self._points, self._failures = name, diary, points, failures
        self._keys = keys

    def execute(self, userdata):
        name = self._name + (str(userdata.item) if 'item' in self._keys else '')
        self._diary.write('begins', name)
        self._points()
        userdata.done = list(userdata.done) + [name]
        self._points()
        self._diary.write('ends', name)
        self._failures -= 1
        return 'aborted' if self._failures >= 0 else 'succeeded'


def around(label, container, leads_to, **others):
    """A machine of a container under a label; each of `others`, states by label, ends it."""
    ends = {'succeeded': 'succeeded', 'aborted': 'aborted'}
    machine = smach.StateMachine(list(ends))
    machine.userdata.done = []
    with machine:
        machine.add(label, container, leads_to)
        for name, state in others.items():
            machine.add(name, state, ends)
    return machine


def each_of(items, label, state):
    """An Iterator over items, of a state that has the key `item`."""
    iterator = smach.Iterator(
        ['succeeded', 'aborted'],
        ['done'],
        ['done'],
        it=items,
        it_label='item',
        exhausted_outcome='succeeded',
    )
    with iterator:
        smach.Iterator.set_contained_state(label, state, loop_outcomes=['succeeded'])
    return iterator


def in_a_process(work, at_stop=None):
    """Run `work()` in a process of its own; return what it has told, None if it was killed.

    `at_stop()`: called each time that it stops itself, before it goes on.
    """
    with tempfile.TemporaryFile() as stream:
        child = os.fork()
        if not child:
            try:
                told = work()
            except BaseException:
                told = {'error': traceback.format_exc()}
            stream.write(json.dumps(told).encode())
            stream.flush()
            os._exit(0)
        status = _ended(child, at_stop)
        assert os.WIFEXITED(status) or os.WTERMSIG(status) == signal.SIGKILL
        stream.seek(0)
        told = stream.read()
    return json.loads(told) if told else None


def _ended(child, at_stop):
    """Wait for a process; return its status."""
    while True:
        _, status = os.waitpid(child, os.WUNTRACED if at_stop else 0)
        if not os.WIFSTOPPED(status):
            return status
        try:
            at_stop()
        except BaseException:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            raise
        os.kill(child, signal.SIGCONT)


class KilledMachine:
    """A machine with a store; `build(diary, points)` makes it again for each process."""

    name = 'TOP'

    def __init__(self, folder, build, **settings):
        self.store = str(folder / 'robot.db')
        self.diary = Diary(str(folder / 'diary'))
        self._build = build
        self._settings = dict(
            {
                'checkpoint': self.store,
                'checkpoint_synchronous': 'OFF',
                'on_resume': 'recover',
                # what was not stored in time would be repeated, on a busy computer
                'checkpoint_wait_s': 60,
            },
            **settings,
        )

    def run(self, kill_at=0, expert=None, stop_at=(), at_stop=None, **settings):
        """Execute it in a process of its own, killed at a point, 0: at none.

        `stop_at`: points at which it stops while `at_stop()` is called here.
        """

        def work():
            points, log = Points(kill_at, stop_at), []
            for level in ('info', 'warn'):
                setattr(smach, 'log' + level, log.append)
            machine = OracleContainer.wrap(
                self._build(self.diary, points),
                name=self.name,
                settings=dict(self._settings, **settings),
                expert=expert,
            )
            kinds, events = [], machine._oracle.events.observers
            ended_by = []
            events.append(points)
            events.append(lambda event: kinds.append((event.kind.name, event.seq, event.state)))
            events.append(
                lambda event: (
                    ended_by.append(event.data['ended_by'])
                    if event.kind is EventKind.TRIAL_END
                    else None
                )
            )
            outcome = machine.execute()
            return {
                'outcome': outcome,
                'points': points.passed,
                'events': kinds,
                'log': log,
                'ended_by': ended_by[-1],
                'ways': {
                    record.label: [[each.way, each.helped] for each in record.ways_so_far()]
                    for record in records_of(machine._oracle)
                },
                'done': machine.userdata.done,
                'rates': [
                    [row.path, row.state, row.successes, row.failures] for row in machine.rates()
                ],
            }

        return in_a_process(work, at_stop)
