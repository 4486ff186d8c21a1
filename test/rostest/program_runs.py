"""Runs the scripts of programs/: bare, with a line that wraps each machine, and under oracle_run.

A script knows nothing of the oracle. Where it says `# built: MACHINE`, the copy for library use has
`OracleContainer.wrap(MACHINE)`, as the documentation shows it.
"""

import json
import re
import shutil
import subprocess
import tempfile
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Tuple

from oracle_support import RUNNER
from warm_python import ORACLE_RUN as IMPORTED_FIRST
from warm_python import WarmPython

PROGRAMS = Path(__file__).resolve().parent / 'programs'
BARE, LIBRARY, ORACLE_RUN = 'bare', 'library', 'oracle_run'
WAYS = (BARE, LIBRARY, ORACLE_RUN)
HUNG_AFTER_S = 100.0
AT_ONCE = 2
# nobody answers; what cannot be recovered from ends as it would have
RECOVERING = {'expert': {'deadline_s': 0.3}}
HELPLESS = {'expert': {'deadline_s': 0.3}, 'max_recoveries': 1}
# what a script is given beside its ending
ARGUMENTS = {'arguments': ['--config', 'x', '--record', '_speed:=5', 'arm:=left_arm']}
_MARKER = re.compile(r'^( *)# built: (.+)$', re.MULTILINE)
_SAID = re.compile(r'[A-Z_]{3,}\b|\w+ (?:is|ends) in ')  # all else is its log
_IN_THREAD = re.compile(
    r'^Exception in thread .*?^\S*(?:Error|Exception)\b.*?$', re.MULTILINE | re.DOTALL
)
_ERROR = re.compile(r'^(?:\w+\.)*(\w+(?:Error|Exception|Interrupt)\b)', re.MULTILINE)


class Ending(NamedTuple):
    """How the process of one program has ended; `code` is None where it hung."""

    code: Any
    said: List[str]  # on stdout, without what it logged
    error: str  # class of the last exception of which it showed a traceback
    output: str  # of stderr

    def last_words(self) -> List[str]:
        """What it says of outcomes."""
        return [line for line in self.said if line.startswith('OUTCOME')]

    def end(self) -> Tuple[Any, str, List[str]]:
        """All that is to be the same where only the way to it may differ."""
        return self.code, self.error, self.last_words()


class Programs:
    """Starts the runs that are asked for, two at a time, each under a node name of its own."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp())
        self._pool = ThreadPoolExecutor(AT_ONCE)
        # the scripts import SMACH and the oracle where they stand
        self._python, self._oracle_run = WarmPython(), WarmPython(*IMPORTED_FIRST)
        self._runs: Dict[Tuple[str, ...], 'Future[Ending]'] = {}
        for name, settings in (('recovering', RECOVERING), ('helpless', HELPLESS)):
            _copy_wrapped(self._folder / name, settings)
            (self._folder / (name + '.yaml')).write_text(json.dumps(settings))

    def begin(
        self, way: str, program: str, how: str, settings: str = 'recovering'
    ) -> 'Future[Ending]':
        """Have a program run; the same run is made once."""
        key = (way, program, how, settings if way != BARE else '')
        if key not in self._runs:
            node = re.sub(r'\W', '_', '_'.join(key))
            command = self._command(*key) + [how]
            python = self._oracle_run if way == ORACLE_RUN else self._python
            self._runs[key] = self._pool.submit(_run, python, command, program, node)
        return self._runs[key]

    def ending(self, *key: str) -> Ending:
        """Wait for the end of a run."""
        return self.begin(*key).result()

    def close(self) -> None:
        self._pool.shutdown()
        self._python.close()
        self._oracle_run.close()
        shutil.rmtree(str(self._folder))

    def _command(self, way: str, program: str, how: str, settings: str) -> List[str]:
        path = str(PROGRAMS / (program + '.py'))
        if way == ORACLE_RUN:
            config = str(self._folder / (settings + '.yaml'))
            return ['-c', RUNNER, '--config', config, path]
        if way == LIBRARY:
            path = str(self._folder / settings / (program + '.py'))
        return [path]


def _copy_wrapped(folder: Path, settings: Dict[str, Any]) -> None:
    folder.mkdir()
    wrapping = (
        r'\1from smach_oracle import OracleContainer'
        + '\n'
        r'\1OracleContainer.wrap(\2, settings={!r})'.format(settings)
    )
    for path in PROGRAMS.glob('*.py'):
        (folder / path.name).write_text(_MARKER.sub(wrapping, path.read_text()))


def _run(python: WarmPython, command: List[str], program: str, node: str) -> Ending:
    command = command + ARGUMENTS.get(program, []) + ['__name:=' + node]
    try:
        ended = python.run(command, HUNG_AFTER_S)
        code, output, errors = ended.returncode, ended.stdout, ended.stderr
    except subprocess.TimeoutExpired as hung:
        code, output, errors = None, str(hung.stdout), str(hung.stderr)
    said = [line for line in output.splitlines() if _SAID.match(line)]
    shown = _ERROR.findall(_IN_THREAD.sub('', errors)) if code else []
    return Ending(code, said, shown[-1] if shown else '', errors)
