#!/usr/bin/env python3
"""A SMACH script whose states start processes and end them. Its argument says which, and how.

It says the same bare and under oracle_run: that is what it is for.
"""

import concurrent.futures
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import smach

SLEEP = [sys.executable, '-c', 'import time; print("up", flush=True); time.sleep(60)']


def sleep(begun=None):
    if begun is not None:
        begun.set()
    time.sleep(60)  # until its parent ends it


def said(text):
    sys.stdout.write('SAID {}\n'.format(text))  # at once: several threads say something
    sys.stdout.flush()


def process(method, ending, waits=True):
    said(ended_process(method, ending, waits).exitcode)


def ended_process(method, ending, waits=True):
    context = multiprocessing.get_context(method)
    begun = context.Event()
    child = context.Process(target=sleep, args=(begun,), daemon=True)
    child.start()
    if waits:
        begun.wait()
    getattr(child, ending)()
    child.join()
    return child


def begin_and_sleep(begun):
    begun()
    time.sleep(60)  # until its parent ends it


def forked(number, work=begin_and_sleep, tell=int):
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        work(lambda: os.write(writing, b'.'))
        os._exit(7)
    os.close(writing)
    os.read(reading, 1)
    if number:
        os.kill(pid, number)
    said(tell(os.waitpid(pid, 0)[1]))


def interrupted():
    def work(begun):
        try:
            begun()
            time.sleep(60)  # until its parent interrupts it
        except KeyboardInterrupt:
            os._exit(9)

    forked(signal.SIGINT, work)


def subprocess_of(**how):
    child = subprocess.Popen(SLEEP, stdout=subprocess.PIPE, **how)
    child.stdout.readline()
    child.terminate()
    said(child.wait())
    child.stdout.close()


def pool(ending):
    workers = multiprocessing.get_context('fork').Pool(2)
    said(workers.map(abs, [-1, -2, -3]))
    waiting = workers.apply_async(time.sleep, (60,))
    waiting.wait(0.1)
    getattr(workers, ending)()
    workers.join()


def executor():
    with concurrent.futures.ProcessPoolExecutor(
        2, mp_context=multiprocessing.get_context('fork')
    ) as workers:
        said(list(workers.map(abs, [-1, -2])))
        os.kill(next(iter(workers._processes)), signal.SIGTERM)
        time.sleep(0.2)  # for the executor to find its worker gone
        try:
            workers.submit(abs, -1).result()
        except concurrent.futures.process.BrokenProcessPool:
            said('broken')


def machine(fails=False):
    work = smach.StateMachine(outcomes=['succeeded', 'aborted'], output_keys=['sum'])
    work.userdata.sum = 0
    with work:
        smach.StateMachine.add('ADD', smach.CBState(add, cb_kwargs={'fails': fails}))
        inner = smach.StateMachine(outcomes=['succeeded', 'aborted'])
        with inner:
            smach.StateMachine.add('REST', smach.CBState(rest))
        smach.StateMachine.add('INNER', inner)
    return work


@smach.cb_interface(outcomes=['succeeded', 'aborted'], input_keys=['sum'], output_keys=['sum'])
def add(userdata, fails):
    userdata.sum += 1
    return 'aborted' if fails else 'succeeded'


@smach.cb_interface(outcomes=['succeeded', 'aborted'])
def rest(userdata):
    return 'succeeded'


def outcome(given):
    work, fails = given
    work = machine(fails) if work is None else work
    ended = work.execute()
    return ended, work.userdata.sum, type(work).__mro__[0].__module__


def machines(work=None):
    with multiprocessing.get_context('fork').Pool(2) as workers:
        said(workers.map(outcome, [(work, fails) for fails in (False, True, False)]))


def machine_known_before():
    work = machine()
    said(work.execute())
    forked(0, lambda begun: said((work.execute(), work.userdata.sum)))


def a_machine_fails():
    work = machine(fails=True)
    forked(0, lambda begun: said((work.execute(), work.userdata.sum)))


def unwinds():
    # SMACH of others makes an error of a SystemExit, and an oracle lets it pass
    forked(0, lambda begun: sys.exit(3), bool)


def returns():
    """The child goes on with the machine around it."""
    raise ChildGoesOn


class ChildGoesOn(Exception):
    """The state is to return in both processes."""


def threads_fork():
    """Other threads fork and end children while the machine runs."""
    children = []

    def fork():
        children.append(ended_process('fork', 'terminate', False))

    threads = [threading.Thread(target=fork) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    # only now: multiprocessing waits for all children wherever one is started, and a thread that
    # finds its own gone may ask for the exit code before the other thread has noted it
    for child in children:
        said(child.exitcode)


KINDS = {
    'fork': lambda: process('fork', 'terminate'),
    'kill': lambda: process('fork', 'kill'),
    'spawn': lambda: process('spawn', 'terminate'),
    'forkserver': lambda: process('forkserver', 'terminate'),
    'at_once': lambda: [process('fork', 'terminate', False) for _ in range(20)],
    'os_fork': lambda: forked(signal.SIGTERM),
    'interrupted': interrupted,
    'own_group': lambda: subprocess_of(start_new_session=True),
    'subprocess': subprocess_of,
    'preexec': lambda: subprocess_of(preexec_fn=lambda: None),
    'pool': lambda: pool('terminate'),
    'executor': executor,
    'machines': machines,
    'machine_known_before': machine_known_before,
    'a_machine_fails': a_machine_fails,
    'unwinds': unwinds,
    'returns': returns,
    'threads': threads_fork,
}


class Plan(smach.State):
    def __init__(self, kind):
        smach.State.__init__(self, outcomes=['succeeded', 'aborted', 'preempted'])
        self._kind = kind

    def execute(self, userdata):
        try:
            KINDS[self._kind]()
        except ChildGoesOn:
            child = os.fork()
            if child:
                said(os.waitpid(child, 0)[1])
            return 'succeeded' if child else 'aborted'
        return 'succeeded'


class Drive(smach.State):
    def __init__(self):
        smach.State.__init__(self, outcomes=['succeeded', 'preempted'])

    def execute(self, userdata):
        for _ in range(10):
            if self.preempt_requested():
                self.service_preempt()
                return 'preempted'
            time.sleep(0.05)  # in all long enough to hear of a signal
        return 'succeeded'


def main():
    if 'node' in sys.argv:
        import rospy

        rospy.init_node('forking')
    top = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('PLAN', Plan(sys.argv[1]), {'succeeded': 'DRIVE'})
        smach.StateMachine.add('DRIVE', Drive())
    said(top.execute())


if __name__ == '__main__':
    main()
