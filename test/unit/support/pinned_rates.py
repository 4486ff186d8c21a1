"""Rates files in which one part after the other is another value, and what becomes of each.

    python3 test/unit/support/pinned_rates.py FOLDER [--pin]

writes that to FOLDER, and with --pin the digests to test/data/pinned/rates.txt. What users see of
a change is the difference of two folders, of before and after it.
"""

import copy
import json
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any, Dict, Iterator, List, Tuple
from unittest import mock

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from pinned import rounded, write_told
from pinned_trees import Told, logged, plan_of
from tree_model.drawing import Shape

from smach_oracle.oracle.machine.nesting import records_of
from smach_oracle.oracle.machine.oracle import load_rates, save_rates
from smach_oracle.oracle.machine.tree_node import marked_node

# small ones of a policy that learns ways: the first one with a window, the second one without
TREES = 577, 1149
SHAPE = Shape(depth=2, concurrent=False, time_limits=False)
GONE = object()  # the part is not there
VALUES: Tuple[Any, ...] = (
    GONE,
    None,
    True,
    -1,
    0,
    3,
    0.5,
    float('nan'),
    float('inf'),
    'x',
    [],
    ['x', 1],
    {},
    {'x': {'x': {}}},
)
Place = Tuple[Any, ...]  # keys from the outside to the inside
# for programs that know no machines: it is read where these are not there
FOR_OTHERS = 'containers'
OWN = r'ways|window: |rate: |successes, failures: |.* is not what was learned'
WORDS_OF_PYTHON = re.compile(r'(cannot be (?:used|read as results of ways): )(?!' + OWN + r').*"')


def tell() -> Dict[str, List[str]]:
    """Return, for each part of each file, a line for each value in its place."""
    with tempfile.TemporaryDirectory() as folder, mock.patch.object(os, 'fsync'):
        path = os.path.realpath(os.path.join(folder, 'rates.json'))
        return {
            '{} {}'.format(number, '/'.join(map(str, place))): _told(machine, path, content, place)
            for number in TREES
            for machine, content in [_learned(number, path)]
            for place in _places(content)
        }


def _learned(number: int, path: str) -> Tuple[Told, Any]:
    """A tree that has learned in some trials, and its rates file."""
    told = Told(plan_of(number, SHAPE), rates_file=path)
    told.run(3)
    return told, json.loads(Path(path).read_text())


def _places(content: Any, place: Place = ()) -> Iterator[Place]:
    """The places of all parts: of a list the first and the last one."""
    yield place
    if isinstance(content, dict):
        for key in sorted({*content} - ({FOR_OTHERS} if not place else set())):
            yield from _places(content[key], (*place, key))
    elif isinstance(content, list):
        for index in sorted({0, len(content) - 1}) if content else ():
            yield from _places(content[index], (*place, index))


def _told(machine: Told, path: str, content: Any, place: Place) -> List[str]:
    """What is said, and what the machine has learned, where each value is in this place."""
    lines = []
    for value in VALUES:
        machine.lines.clear()
        Path(path).write_text(json.dumps(content))
        _read(machine, path)
        machine.lines.clear()
        Path(path).write_text(json.dumps(_changed(content, place, value)))
        _read(machine, path)
        shown = 'GONE' if value is GONE else repr(value)
        lines += [
            '{}: {}'.format(shown, WORDS_OF_PYTHON.sub(r'\1"', line)) for line in machine.lines
        ]
    return lines


def _read(machine: Told, path: str) -> None:
    """Have a machine read its rates file and write it, and tell what is known then."""
    node = marked_node(machine.machine)
    node.tree.rates_loaded = ''
    with logged(lambda what, text: machine.tell(what, text.replace(path, 'FILE'))):
        load_rates(node)
        machine.tell('RATES', machine.machine.rates())
        for record in records_of(node):
            machine.tell('WAYS ' + record.label, record.ways_so_far())
        save_rates(node)
    machine.lines.append('FILE {}'.format(rounded(Path(path).read_text())))


def _changed(content: Any, place: Place, value: Any) -> Any:
    """The content with another value in a place."""
    if not place:
        return None if value is GONE else value
    changed = copy.deepcopy(content)
    part = changed
    for key in place[:-1]:
        part = part[key]
    if value is GONE:
        del part[place[-1]]
    else:
        part[place[-1]] = value
    return changed


if __name__ == '__main__':
    write_told('rates', tell(), Path(sys.argv[1]), '--pin' in sys.argv)
