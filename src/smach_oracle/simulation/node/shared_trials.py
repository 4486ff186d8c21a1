#!/usr/bin/env python3
"""Run a task's trials, where some were run by another variant and would be the same here.

In such a trial nothing failed. The machine is executed in it, and its states only return what they
returned there: so its oracle learns what it would have learned, and its recorder writes a bag. The
world stands still meanwhile, and its truth on the trial is that of the other variant.
"""

import argparse
import importlib
import json
import sys
import threading
import time
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

import rospy
from std_msgs.msg import Header

from smach_oracle.msg import TrialCause
from smach_oracle.ros.attachment import attachments
from smach_oracle.simulation.node.truth_file import append_line

CAUSE = '/world/cause'
CAUSE_WAIT_S = 10.0  # until a message comes back through the node's own subscription


class CauseTopic:
    """The topic of causes, on which this node stands in for the world.

    It is not latched, so that no later trial begins with it. It is published before a machine is
    executed for the first time: so the recorder subscribes at once.
    """

    def __init__(self) -> None:
        self._publisher = rospy.Publisher(CAUSE, TrialCause, queue_size=10)

    def tell(self, cause: TrialCause) -> None:
        """Publish the cause of a trial, and wait until the recorder of this process has it.

        :raises RuntimeError: where it does not come.
        """
        here = threading.Event()
        # the subscriptions of a process are one. They are called in the order of their beginnings
        subscriber = rospy.Subscriber(CAUSE, TrialCause, _setter(here, cause.seed))
        try:
            connected = threading.Event()
            until = time.monotonic() + CAUSE_WAIT_S
            while not self._publisher.get_num_connections():
                if time.monotonic() > until:
                    raise RuntimeError('{}: nobody subscribes'.format(CAUSE))
                connected.wait(0.01)  # rospy tells nobody when a subscriber has connected
            self._publisher.publish(cause)
            if not here.wait(CAUSE_WAIT_S):
                raise RuntimeError('{}: the cause of a trial does not come'.format(CAUSE))
        finally:
            subscriber.unregister()


def _setter(event: threading.Event, seed: int) -> Callable[[TrialCause], None]:
    def come(message: TrialCause) -> None:
        if message.seed == seed:
            event.set()

    return come


class SharedTrial:
    """A trial of another variant in which nothing failed."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.truth: Mapping[str, Any] = data['truth']
        self.ended: str = data['ended']
        self._outcomes: Sequence[Tuple[str, str]] = [
            (state, outcome) for state, outcome in data['outcomes']
        ]
        self._took_s: float = data['took_s']
        self._cause = TrialCause(
            Header(), data['seed'], data['task'], data['kinds'], data['details']
        )

    def replay(self, machine: Any, causes: CauseTopic) -> None:
        """Execute a machine whose states return what they returned in the trial.

        :raises RuntimeError: where it goes another way.
        """
        left = list(self._outcomes)
        wrong: List[str] = []

        def visit(label: str) -> str:
            try:
                if len(left) == len(self._outcomes):
                    self._cause.header.stamp = rospy.Time.now()
                    causes.tell(self._cause)
                if left and left[0][0] == label:
                    if len(left) == 1:
                        _pass_by(self._took_s)
                    return left.pop(0)[1]
                wrong.append('it comes to {}'.format(label))
            except (RuntimeError, rospy.ROSException) as err:  # nothing to recover from
                wrong.append(str(err))
            return self.ended

        with _replaced(machine.get_children(), visit):
            machine.userdata = type(machine.userdata)()
            ended = machine.execute()
        if wrong or left or ended != self.ended:
            raise RuntimeError(
                'seed {}: the machine does not go as in the shared trial: {}'.format(
                    self._cause.seed, ', '.join(wrong) or 'it ends in {}'.format(ended)
                )
            )


def _pass_by(seconds: float) -> None:
    """Have the trial that goes on count as one that takes so much of the world's time."""
    clock = attachments().work_clock
    if clock is not None:
        clock.pass_by(seconds)


class _replaced:
    """States whose `execute` is another function. Each keeps its object and its class."""

    def __init__(self, states: Mapping[str, Any], visit: Callable[[str], str]) -> None:
        self._states, self._visit = states, visit

    def __enter__(self) -> None:
        for label, state in self._states.items():
            vars(state)['execute'] = self._standing_for(label)

    def _standing_for(self, label: str) -> Callable[..., str]:
        return lambda *_args, **_kwargs: self._visit(label)

    def __exit__(self, *_error: object) -> None:
        for state in self._states.values():
            vars(state).pop('execute', None)


def read_shared(path: str) -> Dict[int, SharedTrial]:
    """Return the trials of a file by seed.

    :raises OSError, ValueError: where it cannot be read.
    """
    with open(path, encoding='utf-8') as source:
        return {data['seed']: SharedTrial(data) for data in json.load(source)}


def run_trials(
    task: Any, seeds: Iterator[int], shared: Mapping[int, SharedTrial], truth_file: str
) -> None:
    """Run or replay the trials in order.

    :raises RuntimeError: where one cannot be.
    :raises OSError: where the truth cannot be written.
    """
    machine, causes = task.make_machine(), CauseTopic()
    for seed in seeds:
        if rospy.is_shutdown():
            return
        trial = shared.get(seed)
        if trial is None:
            task.run_trials(machine, 1, seed)
            continue
        trial.replay(machine, causes)
        if rospy.is_shutdown():  # it may have been stopped in the middle
            return
        append_line(truth_file, trial.truth)
        rospy.loginfo('trial of seed %d: shared, %s', seed, trial.ended)


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--task', required=True, help='name of its module in smach_oracle.tasks')
    parser.add_argument('--trials', type=int, required=True)
    parser.add_argument('--seed', type=int, required=True, help='of the first trial')
    parser.add_argument('--shared', required=True, help='file of trials that are not run here')
    parser.add_argument('--truth', required=True, help='file that gets the truth on them')
    args = parser.parse_args(rospy.myargv(argv if argv is not None else sys.argv)[1:])
    task = importlib.import_module('smach_oracle.tasks.' + args.task)
    rospy.init_node(args.task)
    seeds = iter(range(args.seed, args.seed + args.trials))
    run_trials(task, seeds, read_shared(args.shared), args.truth)
    return 0


if __name__ == '__main__':
    sys.exit(main())
