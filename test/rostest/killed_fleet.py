"""Robots under oracle_run with a store, one expert server, consoles, an action server and a master:
any of them is killed by SIGKILL and comes up again, as under respawn.

Shared by the benchmarks of killed nodes and of a fleet under faults, and by a rostest.
"""

import collections
import json
import os
import random
import subprocess
import sys
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional

from own_master import wait_for_master
from waiting import wait_for

from smach_oracle.experiment.launching import free_port
from smach_oracle.store.names import ASKED
from smach_oracle.store.store_file import StoreFile

HERE = os.path.dirname(os.path.abspath(__file__))
SCRIPTS = os.path.join(HERE, os.pardir, os.pardir, 'scripts')
SERVER = '/shared/expert_query'
KINDS = ('server', 'console', 'interface', 'action', 'roscore', 'robot', 'all')
END_S = 240.0  # within which every robot ends once it may
CLOSING = ('QUERY_ANSWERED', 'QUERY_EXPIRED', 'QUERY_CANCELLED')


class Program:
    """A program that can be killed and comes up again."""

    def __init__(self, command: List[str], env: Dict[str, str], log: str) -> None:
        self._command, self._env, self._log = command, env, log
        self._process: Optional[subprocess.Popen] = None

    @property
    def pid(self) -> int:
        return self._process.pid if self._process is not None else 0

    def start(self) -> None:
        with open(self._log, 'ab') as log:
            self._process = subprocess.Popen(
                self._command,
                env=self._env,
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
            )

    def runs(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def state(self) -> Dict[str, int]:
        """Memory, kB, threads and open files of its process."""
        with open('/proc/{}/status'.format(self.pid)) as stream:
            told = dict(line.split(':', 1) for line in stream)
        return {
            'kB': int(told['VmRSS'].split()[0]),
            'threads': int(told['Threads']),
            'files': len(os.listdir('/proc/{}/fd'.format(self.pid))),
        }


class Found(NamedTuple):
    """What is found once all robots have ended; `wrong`: what did not hold."""

    rounds: int
    questions: int
    answered: int
    expired: int
    resumed: int
    wrong: List[str]


class KilledFleet:
    """All programs of a fleet, with a master of their own."""

    def __init__(
        self,
        folder: str,
        robots: int,
        consoles: int = 1,
        deadline_s: float = 300.0,
        lease_s: float = 5.0,
    ) -> None:
        self._folder = folder
        self._port = free_port()
        self.uri = 'http://localhost:{}'.format(self._port)
        self.env = dict(
            os.environ,
            ROS_MASTER_URI=self.uri,
            ROS_HOSTNAME='localhost',
            ROS_LOG_DIR=os.path.join(folder, 'log'),
            PYTHONUNBUFFERED='1',
        )
        self.robots = [str(number) for number in range(robots)]
        self._settings(deadline_s)
        self.programs: Dict[str, Program] = collections.OrderedDict()
        self._add('roscore', ['rosmaster', '--core', '-p', str(self._port)])
        self._add(
            'server',
            self._script('expert_query_server', '__name:=shared', '_lease_s:={}'.format(lease_s)),
        )
        for number in range(consoles):
            self._add(
                'console_{}'.format(number),
                self._script(
                    'expert_console',
                    '__name:=console_{}'.format(number),
                    '_port:={}'.format(free_port()),
                ),
            )
        # it is a front end as the consoles are, and there is nobody else to answer
        self._add(
            'expert',
            self._script(
                'scripted_expert', '__name:=expert', '_rules:=' + json.dumps(self._rules())
            ),
        )
        self._add('interface', self._script('perception_interface', '__name:=looks'))
        self._add(
            'action',
            [
                sys.executable,
                os.path.join(HERE, 'smach_ros_action_node.py'),
                '/arm',
                '__name:=serves_arm',
            ],
        )
        for number in self.robots:
            self._add(
                'robot_' + number,
                self._script(
                    'oracle_run',
                    '--config',
                    os.path.join(folder, 'oracle.yaml'),
                    '--checkpoint',
                    os.path.join(folder, 'robots.db'),
                    '--resume=recover',
                    '--machine-name',
                    'JOB_' + number,
                    os.path.join(HERE, 'killed_robot.py'),
                    folder,
                    number,
                    '_expert_query_server:=' + SERVER,
                    '__name:=robot_' + number,
                ),
            )

    @staticmethod
    def _script(name: str, *words: str) -> List[str]:
        return [sys.executable, os.path.join(SCRIPTS, name), *words]

    def _add(self, name: str, command: List[str]) -> None:
        self.programs[name] = Program(command, self.env, os.path.join(self._folder, name + '.log'))

    def _settings(self, deadline_s: float) -> None:
        with open(os.path.join(self._folder, 'oracle.yaml'), 'w') as stream:
            json.dump(
                {
                    'max_recoveries': 0,
                    'policy': 'prose',
                    'expert': {'deadline_s': deadline_s},
                    'checkpoint': {'on_resume': 'recover'},
                    'userdata': 'keep',
                },
                stream,
            )

    def _rules(self) -> Dict[str, Any]:
        """Every robot's states lead to themselves, but WORK to TELL."""
        rules: Dict[str, Any] = {}
        for number in self.robots:
            for label, target in (('MOVE_', 'MOVE_'), ('WORK_', 'TELL_'), ('TELL_', 'TELL_')):
                rules[label + number] = {'kind': 'goto', 'state': target + number}
        return rules

    def start(self) -> None:
        self.programs['roscore'].start()
        wait_for_master(self.uri)
        for name, program in self.programs.items():
            if name != 'roscore':
                program.start()

    def stop(self) -> None:
        for program in self.programs.values():
            program.kill()

    def kill(self, kind: str) -> None:
        """Kill programs of a kind, and start them again."""
        names = {
            'all': list(self.programs),
            'roscore': ['roscore', 'action'],
            'console': ['console_0', 'expert'],
        }.get(kind, [name for name in self.programs if name.split('_')[0] == kind])
        if kind == 'robot':
            names = [random.choice([name for name in names if not self._has_ended(name)] or names)]
        for name in names:
            self.programs[name].kill()
        for name in names:
            if not self._has_ended(name):
                self.programs[name].start()
                if name == 'roscore':
                    wait_for_master(self.uri)

    def _has_ended(self, name: str) -> bool:
        return name.startswith('robot_') and any(
            line['what'] == 'ended' for line in self.journal() if line['robot'] == name[6:]
        )

    def journal(self) -> List[Dict[str, Any]]:
        """What the robots have told."""
        try:
            with open(os.path.join(self._folder, 'journal')) as stream:
                return [json.loads(line) for line in stream]
        except FileNotFoundError:
            return []

    def rounds(self) -> int:
        return sum(line['what'] == 'round' for line in self.journal())

    def run_under_kills(
        self,
        draw: Callable[[], str],
        kills: int,
        seed: int,
        longest_s: float,
        told: Callable[[int], Any] = lambda number: None,
    ) -> None:
        """Kill so often, each at a random instant behind some progress; then let all end."""
        chance = random.Random(seed)
        for number in range(kills):
            before = self.rounds()
            self.respawn_until(lambda least=before: self.rounds() > least, END_S)
            time.sleep(chance.uniform(0.0, longest_s))  # the instant itself is what is tried
            self.kill(draw())
            told(number)
        open(os.path.join(self._folder, 'stop'), 'w').close()
        self.respawn_until(
            lambda: all(self._has_ended('robot_' + each) for each in self.robots), END_S
        )

    def respawn_until(self, condition: Callable[[], Any], limit_s: float) -> bool:
        """Start again what has ended by itself, until a condition holds."""

        def look() -> bool:
            for name, program in self.programs.items():
                if not program.runs() and not self._has_ended(name):
                    program.start()
            time.sleep(0.1)  # a journal is read each time
            return bool(condition())

        return bool(wait_for(look, limit_s))

    # -- what must hold

    def judge(self) -> Found:
        """Hold the journal and the store against what must hold."""
        wrong: List[str] = []
        by_robot = {
            number: [line for line in self.journal() if line['robot'] == number]
            for number in self.robots
        }
        for number, lines in by_robot.items():
            ended = [line['outcome'] for line in lines if line['what'] == 'ended']
            if ended != ['succeeded']:
                wrong.append('robot {} ended as {}'.format(number, ended))
            rounds = [line['round'] for line in lines if line['what'] == 'round']
            if rounds != sorted(rounds) or set(rounds) != set(range(max(rounds, default=-1) + 1)):
                wrong.append('robot {}: rounds out of turn: {}'.format(number, rounds))
            begun = sum(line['what'] == 'begins' for line in lines)
            if len(rounds) - len(set(rounds)) >= max(begun, 1):
                wrong.append(
                    'robot {}: {} rounds again, {} processes'.format(
                        number, len(rounds) - len(set(rounds)), begun
                    )
                )
        counts = self._questions(wrong)
        return Found(
            self.rounds(),
            counts['questions'],
            counts['QUERY_ANSWERED'],
            counts['QUERY_EXPIRED'],
            counts['RESUMED'],
            wrong,
        )

    def _questions(self, wrong: List[str]) -> Dict[str, int]:
        """Count the questions by how they ended; each is closed once, and asked for its robot."""
        counts: Dict[str, int] = collections.Counter()
        store = StoreFile(os.path.join(self._folder, 'robots.db'), read_only=True)
        for trial in store.trials():
            closed: Dict[str, int] = collections.Counter()
            current = ''
            asked = {
                fact.moment: json.loads(fact.value.text)
                for fact in store.facts(trial.number)
                if fact.name == ASKED and fact.value.is_there
            }
            for moment in store.moments(trial.number):
                counts[moment.kind] += 1
                if moment.number in asked:
                    current = asked[moment.number][1]
                    closed[current] += 0
                if moment.kind in CLOSING:
                    closed[current] += 1
            counts['questions'] += len(closed)
            wrong += [
                'question {} of {} was closed {} times'.format(each, trial.machine, times)
                for each, times in closed.items()
                if times != 1
            ]
        return counts
