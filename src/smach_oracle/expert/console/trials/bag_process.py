"""Reads bags in a process of its own, and ends that where it takes too long."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from typing import List

from smach_oracle.analysis.bag_worker import BagReadError, BagReply, BagRequest, reply_of

from .bag_folders import BagFolders

WALL_LIMIT_S = 300.0  # it may have to wait for a slow disk, or for the machine
_WORKER = 'smach_oracle.analysis.bag_worker'
# the libraries below numpy take memory for each of their threads
_ONE_THREAD = {'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1'}


def read_bags(
    folders: BagFolders, request: BagRequest, wall_limit_s: float = WALL_LIMIT_S
) -> BagReply:
    """Read bags of the folders.

    The process is given open files: whatever their names lead to meanwhile, it opens none by a
    name.

    :raises BagReadError: where one cannot be used, or takes more than the limits.
    :raises FileNotFoundError: where one is gone.
    """
    files: List[int] = []
    try:
        for position, path in enumerate(request.paths):
            try:
                files.append(folders.open(path))
            except BagReadError as err:
                raise BagReadError(str(err), position) from err
        named = request._replace(paths=['/proc/self/fd/{}'.format(each) for each in files])
        return _reply(named, files, wall_limit_s)
    finally:
        for each in files:
            os.close(each)


def _reply(request: BagRequest, files: List[int], wall_limit_s: float) -> BagReply:
    worker = subprocess.Popen(
        [sys.executable, '-m', _WORKER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        pass_fds=files,
        start_new_session=True,
        cwd='/',
        env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path), **_ONE_THREAD),
    )
    try:
        text, _ = worker.communicate(json.dumps(request).encode(), wall_limit_s)
    except subprocess.TimeoutExpired as err:
        raise BagReadError('it takes more than {:g} s'.format(wall_limit_s)) from err
    finally:
        worker.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):  # its disk may hold it for good
            worker.communicate(timeout=5.0)
    if worker.returncode == -signal.SIGXCPU:
        raise BagReadError('it takes more than {} s of computing'.format(request.cpu_s))
    try:
        return reply_of(text)
    except (ValueError, TypeError, KeyError) as err:
        raise BagReadError(
            'the process that read it has ended ({})'.format(worker.returncode)
        ) from err
