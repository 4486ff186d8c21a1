"""Events as lines of text, and the files that hold those of test/data/pinned."""

import hashlib
import json
import random
import re
from pathlib import Path

from smach_oracle.oracle.records.events import EventKind, FailureKind

FOLDER = Path(__file__).resolve().parents[2] / 'data/pinned'
SECONDS = re.compile(r'(?:under )?\d+(?:\.\d+)?(?:e-\d+)? s\b')
ADDRESS = re.compile(r' at 0x[0-9a-f]+')
NUMBER = re.compile(r'-?\d+\.\d+(?:e-?\d+)?')
# settings are held elsewhere, and how long something took is never the same
NOT_HELD = ('settings', 'failure_rule', 'origin', 'inputs')


def held(name):
    """The lines of a file."""
    return (FOLDER / (name + '.txt')).read_text('utf-8').splitlines()


def rounded(text):
    """A text with three digits of each number behind its point."""
    return NUMBER.sub(lambda found: '{:.3f}'.format(float(found.group())), text)


def drawn(groups, draws):
    """Lines of so many draws each, by what they are about and a number.

    `groups`: what it is, how many numbers, and a function of a generator of random numbers that
    yields the lines of one draw.
    """
    return {
        '{} {}'.format(what, number): [
            rounded('{}: {}'.format(seed, line))
            for seed in range(number * draws, (number + 1) * draws)
            for line in lines_of(random.Random('{} {}'.format(what, seed)))
        ]
        for what, numbers, lines_of in groups
        for number in range(numbers)
    }


def digest_of(lines):
    """The digest of some lines."""
    return hashlib.sha256('\n'.join(lines).encode()).hexdigest()[:10]


def digests_of(told):
    """A line for each of `told`, lists of lines by name: the name, and the digest of its lines."""
    return ['{}: {}'.format(name, digest_of(lines)) for name, lines in told.items()]


def write_told(what, told, folder, pins):
    """Write all lines to a file of that name in a folder. `pins`: their digests here, too."""
    folder.mkdir(exist_ok=True)
    for place, lines in (
        (folder, ['\n    '.join([name, *told[name]]) for name in told]),
        (FOLDER, digests_of(told) if pins else []),
    ):
        if lines:
            (place / (what + '.txt')).write_text(''.join(line + '\n' for line in lines), 'utf-8')


def told(events, concurrence=''):
    """A line for each event. Those inside a concurrence (a path) come branch by branch."""
    return [line_of(event) for event in _by_branch(events, concurrence)]


def line_of(event):
    """What an event tells, apart from its numbers, times and ids."""
    words = ['{:15}'.format(event.kind.name), '/'.join(filter(None, (event.path, event.state)))]
    if event.outcome or event.target:
        words.append('({})'.format(event.outcome))
    if event.target:
        words.append('> ' + event.target)
    if event.failure_kind:
        words.append(FailureKind(event.failure_kind).name)
    if event.kind is EventKind.FAILURE:
        words.append(
            'class {}, rate {:.2f}{}'.format(
                int(event.failure_class), event.rate, ', again' if event.continuous else ''
            )
        )
    if event.by:
        words.append('by ' + event.by)
    if event.text:
        words.append('"{}"'.format(ADDRESS.sub('', SECONDS.sub('# s', event.text))))
    data = {
        key: value
        for key, value in (event.data or {}).items()
        if key not in NOT_HELD and not key.endswith('_s')
    }
    if data:
        words.append(json.dumps(data, sort_keys=True))
    return ' '.join(words)


def _by_branch(events, concurrence):
    """The events; in each execution of the concurrence one branch after the other."""
    keys, execution = [], 0
    for event in events:
        branch = _branch_of(event, concurrence) if concurrence else ''
        execution += event.kind is EventKind.CONTAINER_START and event.path == concurrence
        keys.append((execution, branch) if branch else None)
    inside = sorted((number for number, key in enumerate(keys) if key), key=keys.__getitem__)
    ordered = iter(inside)
    return [events[next(ordered) if key else number] for number, key in enumerate(keys)]


def _branch_of(event, concurrence):
    """The label of the branch of an event, '' for what is not in a branch."""
    is_own = event.kind in (EventKind.CONTAINER_START, EventKind.CONTAINER_END)
    if is_own and event.path == concurrence:
        return ''
    path = '/'.join((event.path, event.state))
    inside = event.path == concurrence or event.path.startswith(concurrence + '/')
    return path[len(concurrence) + 1 :].split('/')[0] if inside else ''
