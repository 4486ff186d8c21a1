#!/usr/bin/env python3
"""The processor time for introspection of an idle tree of containers: the time that the node's
process takes, as a share of one core.

    benchmarks/introspection.py [--upstream PATH] [--containers N] [--seconds S] [--check]

Each row is a node on a master of its own: without a server, with ours, and with that of the
checkout of executive_smach at PATH, on that checkout's engine. A viewer runs as another process,
and reads structure and status of every container. What the node takes without a server is
subtracted. The time is that of the process, not of the wall, and the nodes are idle, so that all
rows are measured at once. --check ends with status 1 where ours takes more than the limit,
or the viewer misses a container.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Optional

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / 'test' / 'rostest'), str(ROOT / 'test')]

LIMIT_PERCENT = 2.0
SERVER = 'viewed'
SETTLE_S = 6.0  # upstream's threads begin one after the other
VIEWER_QUEUE = 50  # as smach_viewer has it
GROUP = 22  # containers below the root; the others are spread below them


class Cost(NamedTuple):
    """The cost of one node."""

    percent: float  # of one core
    threads: int  # of Python, in the node
    structures: int  # containers whose structure the viewer had in the time
    statuses: int  # containers whose status it had


def main() -> int:
    options = parse()
    if options.role == 'node':
        return be_node(options)
    if options.role == 'viewer':
        return be_viewer(options)
    return report(measure_all(options), options)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--upstream', metavar='PATH', help='checkout of executive_smach, to be measured too'
    )
    parser.add_argument('--containers', type=int, default=500, help='(default: %(default)s)')
    parser.add_argument(
        '--seconds',
        type=float,
        default=20.0,
        help='that each row is measured (default: %(default)s)',
    )
    parser.add_argument(
        '--check', action='store_true', help='fail above {:g} %% of a core'.format(LIMIT_PERCENT)
    )
    parser.add_argument('--role', default='', help=argparse.SUPPRESS)
    parser.add_argument('--server', default='', help=argparse.SUPPRESS)
    parser.add_argument('--wrapped', action='store_true', help=argparse.SUPPRESS)
    return parser.parse_args()


@contextmanager
def master() -> Iterator[Dict[str, str]]:
    """A master on a free port. Yields the variables of those who are to use it."""
    from own_master import wait_for_master

    from smach_oracle.experiment.launching import free_port

    port = free_port()
    uri = 'http://localhost:{}'.format(port)
    process = subprocess.Popen(
        ['rosmaster', '--core', '-p', str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_for_master(uri)
        yield {'ROS_MASTER_URI': uri}
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


# -- the rows


def measure_all(options: argparse.Namespace) -> Dict[str, Cost]:
    """Measure the cost of each row."""
    rows = {
        'no server': partial(measure, options, 'none', viewed=False),
        'ours': partial(measure, options, 'ours', viewed=False),
        'ours, with a viewer': partial(measure, options, 'ours', viewed=True),
        'ours, wrapped, with a viewer': partial(
            measure, options, 'ours', viewed=True, wrapped=True
        ),
    }
    if options.upstream:
        from harness.upstream import environment

        upstream = environment(Path(options.upstream).resolve())
        rows['upstream'] = partial(measure, options, 'upstream', viewed=False, more_env=upstream)
        rows['upstream, with a viewer'] = partial(
            measure, options, 'upstream', viewed=True, more_env=upstream
        )
        rows["ours on upstream's engine, wrapped, with a viewer"] = partial(
            measure, options, 'ours', viewed=True, wrapped=True, more_env=upstream
        )
    with ExitStack() as closing, ThreadPoolExecutor(len(rows)) as pool:
        masters = [closing.enter_context(master()) for _ in rows]
        costs = {
            name: pool.submit(row, on_master=on_master)
            for (name, row), on_master in zip(rows.items(), masters)
        }
        return {name: cost.result() for name, cost in costs.items()}


def measure(
    options: argparse.Namespace,
    server: str,
    viewed: bool,
    wrapped: bool = False,
    more_env: Optional[Dict[str, str]] = None,
    *,
    on_master: Dict[str, str],
) -> Cost:
    """Run one node, with a viewer perhaps."""
    viewer = start(options, ['--role', 'viewer'], on_master) if viewed else None
    node = start(
        options,
        ['--role', 'node', '--server', server] + ['--wrapped'] * wrapped,
        dict(on_master, **(more_env or {})),
    )
    try:
        told = json.loads(said(node))
        seen = json.loads(said(viewer)) if viewer is not None else [0, 0]
    finally:
        for process in (node, viewer):
            if process is not None:
                process.kill()  # upstream's threads keep the process alive
                process.wait()
    return Cost(told['percent'], told['threads'], *seen)


def start(options: argparse.Namespace, role: List[str], more_env: Dict[str, str]) -> Any:
    command = [
        sys.executable,
        __file__,
        '--containers',
        str(options.containers),
        '--seconds',
        str(options.seconds),
    ]
    return subprocess.Popen(
        command + role, env=dict(os.environ, **more_env), stdout=subprocess.PIPE
    )


def said(process: Any) -> str:
    """The line that tells what a process measured."""
    for line in process.stdout:
        if line.startswith(b'MEASURED '):
            return str(line.decode().split(' ', 1)[1])
    raise RuntimeError('{} ended without a result'.format(process.args))


# -- the node


def make_tree(count: int, wrapped: bool) -> Any:
    """A machine that holds so many containers, itself included, three levels deep.

    Each has three states and three keys.
    """
    root = make_container()
    groups = [make_container() for _ in range(min(GROUP, count - 1))]
    for number in range(count - 1 - len(groups)):
        smach_add(groups[number % len(groups)], 'LEAF_{}'.format(number), make_container())
    for number, group in enumerate(groups):
        smach_add(root, 'GROUP_{}'.format(number), group)
    if wrapped:
        from smach_oracle.oracle import OracleContainer

        OracleContainer.wrap(root, name='TREE')
    return root


def make_container() -> Any:
    import smach

    machine = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    machine.userdata.update(make_userdata(smach))
    with machine:
        for label, following in (('DETECT', 'PICK'), ('PICK', 'PLACE'), ('PLACE', 'succeeded')):
            smach.StateMachine.add(
                label, smach.State(outcomes=['succeeded', 'aborted']), {'succeeded': following}
            )
    return machine


def make_userdata(smach: Any) -> Any:
    userdata = smach.UserData()
    for key, value in (('object', 'mug'), ('attempts', 3), ('place', [0.5, 1.0, 0.75])):
        userdata[key] = value
    return userdata


def smach_add(machine: Any, label: str, state: Any) -> None:
    import smach

    with machine:
        smach.StateMachine.add(label, state, {'succeeded': 'DETECT'})


def be_node(options: argparse.Namespace) -> int:
    import rospy

    rospy.init_node('viewed', disable_signals=True, log_level=rospy.WARN)
    tree = make_tree(options.containers, options.wrapped)
    server = make_server(options.server, tree)
    if server is not None:
        server.start()
    time.sleep(SETTLE_S)
    began_s, cpu_s = time.monotonic(), time.process_time()
    time.sleep(options.seconds)
    share = (time.process_time() - cpu_s) / (time.monotonic() - began_s)
    print(
        'MEASURED ' + json.dumps({'percent': 100.0 * share, 'threads': threading.active_count()}),
        flush=True,
    )
    rospy.signal_shutdown('measured')
    return 0


def make_server(kind: str, tree: Any) -> Any:
    if kind == 'none':
        return None
    if kind == 'upstream':
        import smach_ros

        return smach_ros.IntrospectionServer(SERVER, tree, '/TREE')
    from smach_common.introspection.introspection_server import IntrospectionServer

    return IntrospectionServer(SERVER, tree, '/TREE')


# -- the viewer


def be_viewer(options: argparse.Namespace) -> int:
    """Count the containers that publish within the measured time."""
    import rospy

    from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure

    rospy.init_node('viewer', anonymous=True, disable_signals=True, log_level=rospy.WARN)
    structures, statuses, begun = set(), set(), threading.Event()

    def noted(paths: Any) -> Any:
        def note(message: Any) -> None:
            begun.set()
            paths.add(message.path)

        return note

    rospy.Subscriber(
        SERVER + '/smach/container_structure',
        SmachContainerStructure,
        noted(structures),
        queue_size=VIEWER_QUEUE,
    )
    rospy.Subscriber(
        SERVER + '/smach/container_status',
        SmachContainerStatus,
        noted(statuses),
        queue_size=VIEWER_QUEUE,
    )
    begun.wait(60.0)
    time.sleep(SETTLE_S)
    for paths in (structures, statuses):
        paths.clear()
    time.sleep(options.seconds - SETTLE_S)
    print('MEASURED ' + json.dumps([len(structures), len(statuses)]), flush=True)
    rospy.signal_shutdown('measured')
    return 0


def report(rows: Dict[str, Cost], options: argparse.Namespace) -> int:
    """Print the table; return the exit status."""
    idle = rows.pop('no server').percent
    print(
        '{} containers; a node without a server takes {:.2f} % of a core'.format(
            options.containers, idle
        )
    )
    print('| server | % of a core | Python threads | structures seen | statuses seen |')
    print('|---|---|---|---|---|')
    for name, cost in rows.items():
        print(
            '| {} | {:.2f} | {} | {} | {} |'.format(
                name, cost.percent - idle, cost.threads, cost.structures, cost.statuses
            )
        )
    for name, theirs in (('ours', 'upstream'), ('ours, with a viewer', 'upstream, with a viewer')):
        if theirs in rows:
            print(
                "{}: upstream's takes {:.0f} times as much".format(
                    name, (rows[theirs].percent - idle) / max(rows[name].percent - idle, 0.01)
                )
            )
    ours = {name: cost for name, cost in rows.items() if name.startswith('ours')}
    missed = [
        name
        for name, cost in ours.items()
        if name.endswith('viewer') and min(cost.structures, cost.statuses) < options.containers
    ]
    dear = [name for name, cost in ours.items() if cost.percent - idle > LIMIT_PERCENT]
    for name in missed + dear:
        print('LIMIT BROKEN: {}'.format(name), file=sys.stderr)
    return int(options.check and bool(missed or dear))


if __name__ == '__main__':
    sys.exit(main())
