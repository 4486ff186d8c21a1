"""Files that users of version 0.1 hold (test/data/v0_1), and how to compare old with new."""

import json
import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Sequence

ROOT = Path(__file__).resolve().parents[3]
SCRIPTS = ROOT / 'scripts'
DATA = ROOT / 'test/data/v0_1'
TRIALS, EXPERIMENT = DATA / 'trials', DATA / 'experiment'
SETTINGS, RATES, EXPECTED = DATA / 'settings', DATA / 'rates', DATA / 'expected'
_RUN_ALL = """
import contextlib, io, json, runpy, sys, traceback
results, answer = [], sys.argv[1]
for line in json.load(sys.stdin):
    sys.argv = line
    out, errors, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        try:
            runpy.run_path(line[0], run_name='__main__')
        except SystemExit as end:
            code = end.code
        except Exception:
            code = 1
            traceback.print_exc()
    results.append([code, out.getvalue(), errors.getvalue()])
with open(answer, 'w') as stream:
    json.dump(results, stream)
"""
_ROUNDING = 1e-12  # relative; another processor or Python may round the last digit otherwise


def bags() -> List[Path]:
    """Every bag."""
    return sorted(DATA.rglob('*.bag'))


def name_of(path: Path) -> str:
    """A file's name below the data."""
    return str(path.relative_to(DATA))


def expected(name: str) -> Any:
    """One of the JSON files with what version 0.1 made of the data."""
    return json.loads((EXPECTED / (name + '.json')).read_text(encoding='utf-8'))


class Result(NamedTuple):
    """One run of a command."""

    code: int
    text: str  # standard output; paths below the data are relative to them
    errors: str


def run_all(calls: Sequence[Sequence[str]], path: str = '') -> List[Result]:
    """Run commands of the package, one after the other, in the folder of the data.

    They run in one process: loading the libraries takes longer than running most commands.
    `path`: where they look for programs first.
    """
    lines = [[str(SCRIPTS / command), *arguments] for command, *arguments in calls]
    # as wide as it gets, so that no line of a help text is broken
    environment = dict(
        os.environ,
        COLUMNS='400',
        PYTHONDONTWRITEBYTECODE='1',
        ROS_MASTER_URI='http://localhost:1',
        PATH=os.pathsep.join(filter(None, [path, os.environ['PATH']])),
    )
    # not standard output: libraries in C write there while they load
    with tempfile.NamedTemporaryFile('r') as answer:
        subprocess.run(
            [sys.executable, '-c', _RUN_ALL, answer.name],
            input=json.dumps(lines),
            cwd=str(DATA),
            env=environment,
            universal_newlines=True,
            timeout=120,
            check=True,
        )
        return [
            Result(code or 0, without_place(text), errors)
            for code, text, errors in json.load(answer)
        ]


def run(command: str, *arguments: str) -> Result:
    """Run one of them."""
    return run_all([(command, *arguments)])[0]


def without_place(text: str) -> str:
    """The same text wherever the data lie."""
    return text.replace(str(DATA) + '/', '')


def numbers(text: str) -> List[float]:
    """The numbers of a text, in their order, except those in names. The words may change."""
    return [float(number) for number in re.findall(r'(?<![\w.])\d+(?:\.\d+)?(?![\w.]*[/_])', text)]


def without_person_needed(text: str) -> str:
    """A text of figures without those of `person needed`, which version 0.1 did not print."""
    of_it = ('person needed', 'at least:', 'Person needed:', 'Expert answered:')
    lines, oracles = [], False
    for line in text.splitlines():
        if line.strip().startswith('At least:') or line.strip().startswith(of_it):
            continue
        if line.startswith('  How many of them'):
            continue
        oracles = oracles and bool(line) or line.endswith('person needed')
        if oracles:
            line = re.sub(r' +(at least )?[\d.]+% \([^)]*\)$', '', line)
        lines.append(line)
    rules = [place for place, line in enumerate(lines) if line and not line.strip('-')]
    if len(rules) == 3:  # Table I, of which it is the last column
        for place in range(rules[1] + 1, rules[2]):
            lines[place] = re.sub(r' +\d+ \([\d.]+%\)$', '', lines[place])
    return '\n'.join(lines)


def lacking(held: Any, now: Any, where: str = '') -> Iterator[str]:
    """Yield each difference. Further keys, and further rows with a name, do not count."""
    if isinstance(held, dict):
        yield from _lacking_keys(held, now, where)
    elif _are_named(held) and _are_named(now):
        yield from _lacking_keys(_by_name(held), _by_name(now), where)
    elif isinstance(held, list) and isinstance(now, list) and len(held) == len(now):
        for position, (one, other) in enumerate(zip(held, now)):
            yield from lacking(one, other, '{}[{}]'.format(where, position))
    elif not _same(held, now):
        yield '{}: it was {!r}, it is {!r}'.format(where, held, now)


def _lacking_keys(held: Dict[str, Any], now: Any, where: str) -> Iterator[str]:
    if not isinstance(now, dict):
        yield '{}: it was {!r}, it is {!r}'.format(where, held, now)
        return
    for key, value in held.items():
        if key in now:
            yield from lacking(value, now[key], '{}.{}'.format(where, key))
        else:
            yield '{}.{} is gone; it was {!r}'.format(where, key, value)


def _are_named(rows: Any) -> bool:
    return (
        isinstance(rows, list)
        and bool(rows)
        and all(isinstance(row, dict) and 'name' in row for row in rows)
    )


def _by_name(rows: Sequence[Dict[str, Any]]) -> Dict[str, Any]:
    return {row['name']: row for row in rows}


def _same(held: Any, now: Any) -> bool:
    if isinstance(held, bool) or isinstance(now, bool):
        return held is now
    if isinstance(held, (int, float)) and isinstance(now, (int, float)):
        return math.isclose(held, now, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
    return type(held) is type(now) and bool(held == now)
