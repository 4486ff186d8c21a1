"""`oracle_run --check`, first half: a process of its own, with a ROS master of its own.

Nothing here imports rospy: the process is told of the private master before anything asks for one.
The master listens to this machine alone. Of the real one only the parameters are read, so that the
script finds what it is set to.
"""

import os
import socket
import sys
import xmlrpc.client
from importlib import import_module
from typing import Any, Dict, List, Sequence

READ_TIMEOUT_S = 3.0
CALLER = '/oracle_run'
SECOND_HALF = 'smach_oracle.ros.oracle_run.script_check'
# remappings that would lead back to the real master, or to other addresses of this machine
_ELSEWHERE = ('__master:=', '__ip:=', '__hostname:=')


def start(args: Sequence[str]) -> None:
    """Go on as a new process, which runs `main` with these arguments. It does not return."""
    code = 'import sys; sys.path[:] = {!r}; from {} import main; main()'.format(
        list(sys.path), __name__
    )
    for number, stream in ((1, sys.stdout), (2, sys.stderr)):
        if stream is None:  # it was closed (`>&-`): nothing is printed there
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            os.set_inheritable(number, True)  # which dup2 leaves alone if it was free, and opened
        else:
            stream.flush()
    os.execv(sys.executable, [sys.executable, '-c', code] + list(args))


def main() -> None:
    """Entry point of the new process."""
    args = sys.argv[1:]
    notes = replace_master(args)
    second_half = import_module(SECOND_HALF)  # only now: it imports rospy
    second_half.check_script([arg for arg in args if not arg.startswith(_ELSEWHERE)], notes)


def replace_master(args: Sequence[str]) -> List[str]:
    """Start a private master, tell this process of it, and fill in the parameters.

    :returns: what people should know of it.
    """
    from rosmaster.master import Master

    real = _real_master(args)
    os.environ['ROS_HOSTNAME'] = 'localhost'
    os.environ.pop('ROS_IP', None)
    master = Master(port=0)
    master.start()
    os.environ['ROS_MASTER_URI'] = master.uri
    if not real:
        return ['ROS_MASTER_URI is not set: the script finds no parameters']
    try:
        parameters = _read_parameters(real)
    except (OSError, xmlrpc.client.Error, ValueError) as err:
        return ['no ROS master at {}: the script finds no parameters ({})'.format(real, err)]
    parameters['use_sim_time'] = False  # there is no clock here
    with xmlrpc.client.ServerProxy(master.uri) as private:
        private.setParam(CALLER, '/', parameters)
    return ['parameters are those of the ROS master at {}, as they are now'.format(real)]


def _real_master(args: Sequence[str]) -> str:
    for arg in args:
        if arg.startswith('__master:='):
            return arg[len('__master:=') :]
    return os.environ.get('ROS_MASTER_URI', '')


def _read_parameters(uri: str) -> Dict[str, Any]:
    """All parameters of a master.

    :raises OSError: where nobody is there or answers in time.
    :raises ValueError: where it refuses.
    """
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(READ_TIMEOUT_S)
    try:
        with xmlrpc.client.ServerProxy(uri) as real:
            answer: Any = real.getParam(CALLER, '/')
    finally:
        socket.setdefaulttimeout(before)
    code, message, value = answer
    if code != 1 or not isinstance(value, dict):
        raise ValueError(message)
    return value
