"""The start of the terminal front end, before it is a node: its command line, and a master."""

import argparse
import getpass
import socket
import time
from typing import Sequence

import rosgraph
from rich.console import Console
from rich.text import Text


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        prog='expert_terminal', description='Answers the questions of robots.'
    )
    parser.add_argument(
        '--server',
        action='append',
        default=[],
        metavar='NAME',
        help='expert query server to follow, e.g. /robot/expert_query; may be given several times '
        '(default: all that the master knows)',
    )
    parser.add_argument(
        '--name',
        default='{}@{}'.format(_user(), socket.gethostname()),
        help='your name, as robots and other experts see it (default: %(default)s)',
    )
    return parser.parse_args(arguments)


def _user() -> str:
    """The user's name, or 'operator'.

    A number may have no name, as in a container.
    """
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # Python 3.13 raises the second
        return 'operator'


def wait_for_master(console: Console) -> None:
    """Wait for the master, and say so. rospy would wait without a word."""
    if not rosgraph.is_master_online():
        console.print(
            Text(
                'No ROS master at {}; waiting. (Ctrl-C quits)'.format(rosgraph.get_master_uri()),
                'yellow',
            )
        )
    while not rosgraph.is_master_online():
        time.sleep(0.5)
