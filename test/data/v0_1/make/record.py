#!/usr/bin/env python3
"""Record the trials: record.py FOLDER, with smach_oracle in the environment and port 21311 free."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).resolve().parent
SETTINGS = HERE.parent / 'settings'
PORT = '21311'
ENVIRONMENT = dict(
    os.environ,
    ROS_MASTER_URI='http://localhost:' + PORT,
    ROS_HOSTNAME='localhost',
    PYTHONUNBUFFERED='1',
    PYTHONDONTWRITEBYTECODE='1',
)
PACKAGE = """<package><name>my_robot</name><version>1.0.0</version><description>x</description>
<maintainer email="me@robot.example">me</maintainer><license>BSD</license></package>
"""
BY_HAND = 'LOOK:purple,none,aborted+REPORT:aborted'
FETCH = [
    'PICK:aborted,dropped',
    'PICK:aborted,aborted,aborted+hand:full+PLACE:raise,raise',
    'LOOK:aborted,aborted,aborted,aborted+PICK:aborted',
    'PLACE:raise,raise@0.25',
]
KITCHEN = [
    'WIPE:aborted+GRASP:aborted,aborted',
    'GRASP:aborted,aborted,aborted,aborted,aborted+door:shut,shut+open_again:aborted',
    'SERVE:aborted,aborted,aborted',
    'OPEN:none,none,none',
]
UNSEEN = '_introspection:=false'
# a server with topics of its own, which are not in the bags
SHARED = '_expert_query_server:=/expert_query_server/expert_query'


@contextmanager
def running(command, ready=None, **options):
    """A process, which is interrupted at the end. `ready`: the node to wait for."""
    process = subprocess.Popen(
        command, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options
    )
    try:
        while ready and ready not in nodes():
            time.sleep(0.2)
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        print(process.communicate(timeout=30)[0].decode())


def nodes():
    """The nodes that the master knows."""
    found = subprocess.run(
        ['rosnode', 'list'],
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        check=False,
    )
    return found.stdout.decode().split()


def oracle_run(script, *arguments, config=None, options=()):
    """Return the command line. Bags lie where it runs."""
    given = ['--config', str(SETTINGS / config)] if config else []
    return [
        'rosrun',
        'smach_oracle',
        'oracle_run',
        '--record',
        '.',
        *given,
        *options,
        str(HERE / script),
        *arguments,
    ]


def run(folder, *arguments, **options):
    """Run a script to its end."""
    folder.mkdir(parents=True, exist_ok=True)
    with running(oracle_run(*arguments, **options), cwd=str(folder)) as process:
        print(process.communicate(timeout=300)[0].decode())


def stop(folder, number, *arguments):
    """Run wait.py, and send it a signal when its second state waits."""
    folder.mkdir(parents=True, exist_ok=True)
    # rosrun replaces itself by the command, so that the signal reaches it
    with running(oracle_run('wait.py', *arguments), cwd=str(folder)) as process:
        for line in process.stdout:
            if b'WAITING' in line:
                break
        time.sleep(0.3)
        process.send_signal(number)
        process.wait(20)


def lose(folder):
    """Leave two events out of the last bag, as somebody may who filters bags."""
    last = sorted(folder.glob('*.bag'))[-1]
    shorter = last.with_name('filtered.bag')
    condition = "not hasattr(m, 'seq') or m.seq not in (4, 6)"
    subprocess.run(
        ['rosbag', 'filter', str(last), str(shorter), condition],
        env=ENVIRONMENT,
        stdout=subprocess.DEVNULL,
        check=True,
    )
    shorter.replace(last)


def compress(bags):
    """As people do with bags that they keep. rosbag leaves the originals behind."""
    subprocess.run(['rosbag', 'compress', '--quiet', *map(str, bags)], env=ENVIRONMENT, check=True)
    for bag in bags:
        bag.with_suffix('.orig.bag').unlink()


def make_interface(folder):
    """A package with the interface that is started on demand."""
    package = folder / 'packages/my_robot'
    package.mkdir(parents=True, exist_ok=True)
    (package / 'package.xml').write_text(PACKAGE, 'utf-8')
    (package / 'by_hand.py').write_text((HERE / 'by_hand.py').read_text('utf-8'), 'utf-8')
    (package / 'by_hand.py').chmod(0o755)
    ENVIRONMENT['ROS_PACKAGE_PATH'] = os.pathsep.join(
        [str(package.parent), ENVIRONMENT['ROS_PACKAGE_PATH']]
    )


def record_with_experts(top):
    """The trials in which somebody answers. Parameters stay with the master from run to run."""
    # the experts need a few seconds to find a server of the robot's own
    run(
        top / 'by_hand',
        'fetch.py',
        BY_HAND,
        '_failure_cameras:=[/camera/compressed]',
        '_oracle:={deadline_s: 8.0}',
        config='fetch.yaml',
    )
    run(
        top / 'by_hand',
        'fetch.py',
        'CARRY:stuck',
        SHARED,
        '_failure_cameras:=[]',
        '_oracle:={}',
        config='fetch.yaml',
    )
    # the second run goes on with the rates that the first one has left
    for words in (FETCH[:2], FETCH[2:]):
        run(top / 'fetch', 'fetch.py', *words, SHARED, UNSEEN, config='fetch.yaml')
    run(top / 'kitchen', 'kitchen.py', *KITCHEN, SHARED, config='kitchen.yaml')


def record_alone(top):
    """The trials in which nobody does."""
    run(
        top / 'fetch_without_oracle',
        'fetch.py',
        'PICK:aborted',
        'PLACE:none',
        UNSEEN,
        options=['--without-oracle'],
    )
    stopped = top / 'stopped'
    stop(stopped, signal.SIGINT, 'program', 'WAIT:slow')
    stop(stopped, signal.SIGTERM, 'program', 'WAIT:slow')
    stop(stopped, signal.SIGINT, 'node', 'WAIT:stuck')
    stop(stopped, signal.SIGKILL, 'program', 'WAIT:slow')
    run(stopped, 'wait.py', 'program', 'nothing')  # its recorder mends the bag of the killed one


def main():
    """Under a roscore of its own."""
    top = Path(sys.argv[1]).resolve()
    ENVIRONMENT['ROS_LOG_DIR'] = str(top / 'log')
    make_interface(top)
    trials = top / 'trials'
    server = ['rosrun', 'smach_oracle', 'expert_query_server', '__name:=expert_query_server']
    expert = [
        'rosrun',
        'smach_oracle',
        'scripted_expert',
        '__name:=scripted_expert',
        '_rules_file:={}'.format(SETTINGS / 'rules.yaml'),
    ]
    with running(['roscore', '-p', PORT], '/rosout'):
        with running(server, '/expert_query_server'), running(expert, '/scripted_expert'), running(
            [str(HERE / 'hesitant.py')], '/hesitant'
        ), running([str(HERE / 'camera.py')], '/camera'):
            record_with_experts(trials)
        record_alone(trials)
    for name in ('by_hand', 'fetch_without_oracle', 'kitchen'):
        compress(sorted((trials / name).glob('*.bag')))
    compress(sorted((trials / 'stopped').glob('*.bag'))[:3])
    lose(trials / 'stopped')


if __name__ == '__main__':
    main()
