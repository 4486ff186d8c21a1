"""An interpreter that has imported ROS's libraries, and forks for each program that it runs.

To import them is most of what a short program costs. SMACH and the oracle are not among them unless
they are named: a program that imports these at a place of its own does so. Where the start of an
interpreter is what a test is about, it starts one.
"""

import array
import gc
import importlib
import json
import os
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
import types
from typing import Any, Dict, List, Optional, Sequence

LIBRARIES = (
    'actionlib',
    'actionlib_msgs.msg',
    'concurrent.futures',
    'diagnostic_msgs.msg',
    'json',
    'numpy',
    'rosgraph_msgs.msg',
    'roslib.message',
    'rospy',
    'rosservice',
    'rostopic',
    'sensor_msgs.msg',
    'sqlite3',
    'std_msgs.msg',
    'std_srvs.srv',
    'yaml',
)
# what `oracle_run` has imported before it runs the first line of a script
ORACLE_RUN = ('smach_oracle.ros.oracle_run.script_runner',)
_LARGEST_REQUEST = 1 << 20  # bytes


class WarmPython:
    """Runs programs as `subprocess.run` would with `sys.executable`. Several threads may.

    :param modules: to be imported before any program, beside ROS's libraries.
    """

    def __init__(self, *modules: str) -> None:
        self._lock = threading.Lock()
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for each in (self._channel, theirs):
            each.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _LARGEST_REQUEST)
        with theirs:
            self._server = subprocess.Popen(
                [sys.executable, os.path.abspath(__file__), str(theirs.fileno()), *modules],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )

    def close(self) -> None:
        """End the interpreter. What still runs goes on."""
        self._channel.close()
        self._server.wait()

    def run(
        self,
        command: Sequence[str],
        timeout: float,
        cwd: Optional[str] = None,
        env: Optional[Dict[str, str]] = None,
    ) -> 'subprocess.CompletedProcess[str]':
        """Run `python3 COMMAND`: `-c CODE` or a path, and arguments. Its input is empty.

        :param timeout: s.
        :raises subprocess.TimeoutExpired: where it is still under way. It has been killed then.
        """
        request = {
            'command': list(command),
            'cwd': cwd or os.getcwd(),
            'env': dict(os.environ if env is None else env),
        }
        pipes = [os.pipe() for _ in ('output', 'errors', 'end')]
        theirs = array.array('i', [writer for _, writer in pipes])
        try:
            with self._lock:
                self._channel.sendmsg(
                    [json.dumps(request).encode()],
                    [(socket.SOL_SOCKET, socket.SCM_RIGHTS, theirs.tobytes())],
                )
        finally:
            for descriptor in theirs:
                os.close(descriptor)
        readers = [reader for reader, _ in pipes]
        try:
            told, in_time = _read_all(readers, time.monotonic() + timeout)
        finally:
            for descriptor in readers:
                os.close(descriptor)
        output, errors, end = (text.decode('utf-8', 'replace') for text in told)
        if not in_time:
            raise subprocess.TimeoutExpired(list(command), timeout, output, errors)
        status = int(end.split()[1])
        code = -os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)
        return subprocess.CompletedProcess(list(command), code, output, errors)


def _read_all(readers: List[int], deadline: float) -> Any:
    """Read to the end. After the deadline the program is killed first, and False comes with it."""
    told = dict.fromkeys(readers, b'')
    in_time = True
    with selectors.DefaultSelector() as selector:
        for reader in readers:
            selector.register(reader, selectors.EVENT_READ)
        while selector.get_map():
            ready = selector.select(max(0.0, deadline - time.monotonic()))
            if not ready:
                if in_time and told[readers[-1]]:
                    os.kill(int(told[readers[-1]].split()[0]), signal.SIGKILL)
                elif not in_time:
                    break  # a child of it holds the pipes
                in_time, deadline = False, time.monotonic() + 5.0
            for key, _ in ready:
                read = os.read(key.fd, 1 << 16)
                told[key.fd] += read
                if not read:
                    selector.unregister(key.fd)
    return [told[reader] for reader in readers], in_time


def _serve(channel: socket.socket) -> Dict[str, Any]:
    """Fork for each request. Return it in the process that runs the program."""
    descriptors = array.array('i', [0] * 3)
    while True:
        text, ancillary, _, _ = channel.recvmsg(
            _LARGEST_REQUEST, socket.CMSG_SPACE(len(descriptors.tobytes()))
        )
        if not text:
            os._exit(0)
        given = array.array('i', ancillary[0][2])
        if not os.fork():
            channel.close()
            return _keep(given, json.loads(text.decode()))
        for descriptor in given:
            os.close(descriptor)
        while os.waitpid(-1, os.WNOHANG)[0]:
            if not _has_children():
                break


def _has_children() -> bool:
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def _keep(given: 'array.array[int]', request: Dict[str, Any]) -> Dict[str, Any]:
    """Fork once more: this process waits for the program, and tells how it has ended."""
    output, errors, end = given
    program = os.fork()
    if not program:
        os.close(end)
        for descriptor, number in ((output, 1), (errors, 2)):
            os.dup2(descriptor, number)
            os.close(descriptor)
        return request
    os.close(output)
    os.close(errors)
    for number in (1, 2):
        os.dup2(0, number)
    os.write(end, '{}\n'.format(program).encode())
    os.write(end, '{}\n'.format(os.waitpid(program, 0)[1]).encode())
    os._exit(0)


def _become(request: Dict[str, Any]) -> Any:
    """Set this process up as the program's. Return its code, and the names of its module."""
    os.chdir(request['cwd'])
    os.environ.clear()
    os.environ.update(request['env'])
    first, *rest = request['command']
    sys.argv = ['-c', *rest[1:]] if first == '-c' else [first, *rest]
    # rospy takes these from the command line as it is imported
    names = sys.modules['rospy.names']
    names._mappings = names.load_mappings(sys.argv)
    if 'smach_oracle.forking' in sys.modules:  # this is a program, not a child that one has forked
        sys.modules['smach_oracle.forking']._forked = False
    module = types.ModuleType('__main__')
    sys.modules['__main__'] = module
    if first == '-c':
        sys.path[0] = ''
        return compile(rest[0], '<string>', 'exec'), vars(module)
    sys.path[0] = os.path.dirname(first)
    module.__file__ = first
    with open(first, 'rb') as source:
        return compile(source.read(), first, 'exec'), vars(module)


def _main() -> Any:
    for name in LIBRARIES + tuple(sys.argv[2:]):
        importlib.import_module(name)
    # as it ends, each program would look through all that was imported here, and copy its memory
    gc.collect()
    gc.freeze()
    return _become(_serve(socket.socket(fileno=int(sys.argv[1]))))


if __name__ == '__main__':
    exec(*_main())
