"""Stands for roslaunch: records the trials that it is told to, without a world."""

import json
import os
import re
import signal
import sys
import time
from pathlib import Path

from smach_oracle.msg import TrialCause
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder

DEADLY_SEED = 101  # of the trial in which the worker dies, where the file is there
FLAG = 'kill_a_worker'


def main() -> None:
    given = dict(each.split(':=', 1) for each in sys.argv[1:] if ':=' in each)
    settings = json.loads(given['oracle'])
    folder, rates = Path(given['record']), Path(settings['rates_file'])
    successes = 0
    if rates.exists():
        successes = json.loads(rates.read_text())['containers']['']['A']['successes']
    first = int(given['seed'])
    for seed in range(first, first + int(given['trials'])):
        print('trial', seed, flush=True)
        if seed == DEADLY_SEED and given['with_oracle'] == 'true':
            kill_worker_once(folder.parent.parent / FLAG)
        successes += 1
        record(folder, seed, successes)
        with open(given['truth'], 'a') as truth:
            truth.write(json.dumps(truth_of(seed)) + '\n')


def kill_worker_once(flag: Path) -> None:
    if flag.exists():
        flag.unlink()
        # the parent is the helper of the worker
        status = Path('/proc/{}/status'.format(os.getppid())).read_text()
        worker = int(re.search(r'^PPid:\s*(\d+)', status, re.MULTILINE).group(1))
        os.kill(worker, signal.SIGKILL)
        time.sleep(600)  # as a world that goes on, until it is told to end


def record(folder: Path, seed: int, successes: int) -> None:
    recorder = TrialRecorder(str(folder))
    source = EventSource(print)
    recorder.attach(source, {'/cause': lambda: TrialCause(seed=seed, task='t', kinds=['odd'])})
    source.begin_trial('trial-{}-{}'.format(seed, os.getpid()))
    source.emit(EventKind.TRIAL_START, 'TOP', data={'recovers': True})
    rate = {'estimator': 'window', 'successes': successes, 'failures': 0, 'window': []}
    end = {'learned': {'': {'A': rate}}}
    source.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded', data=end)
    assert recorder.close(60.0)


def truth_of(seed: int) -> dict:
    told = {'seed': seed, 'task': 't', 'success': True, 'why': '', 'causes': []}
    return {**told, 'sim_s': 1.0, 'wall_s': 1.0, 'share': {}}


if __name__ == '__main__':
    signal.signal(signal.SIGINT, lambda *_: sys.exit(1))
    main()
