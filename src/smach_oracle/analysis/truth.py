"""The world's own record of how each trial ended: `truth.jsonl` beside the bags.

One JSON object a line: {"seed", "task", "success", "why", "wrong_object", "damage", "causes":
[{"kind", "text"}], "sim_s", "wall_s", "share"}. Older lines have no "wrong_object" and "damage".
"""

import json
import os
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Tuple

from .bag_events import BagError

TRUTH_FILE = 'truth.jsonl'
SHARED = 'shared'  # key of a line that was told in another job, for a trial that both share
# kinds. Each lists names of things
DAMAGE = ('knocked_over', 'dropped', 'pushed_off', 'driven_against')
# by name: the types that are allowed, and their name
Allowed = Mapping[str, Tuple[Tuple[type, ...], str]]
_FIELDS: Allowed = {
    'seed': ((int,), 'an int'),
    'task': ((str,), 'a str'),
    'success': ((bool,), 'a bool'),
    'why': ((str,), 'a str'),
    'causes': ((list,), 'a list'),
    'sim_s': ((int, float), 'a number'),
    'wall_s': ((int, float), 'a number'),
    'share': ((dict,), 'a dict'),
}
_LATER_FIELDS: Allowed = {'wrong_object': ((str,), 'a str'), 'damage': ((dict,), 'a dict')}


class Truth(NamedTuple):
    """The true end of one trial."""

    seed: int
    task: str
    success: bool
    why: str
    causes: Tuple[Tuple[str, str], ...]  # kind, in words
    sim_s: float  # simulated time that the trial took
    wall_s: float  # time that it took
    share: Mapping[str, float]  # of wall_s, per part of the simulation
    wrong_object: str = ''  # another thing than the task's own that was brought to the goal
    # kind (one of DAMAGE) and thing, once for each time. None means the line is older than that
    damage: Optional[Tuple[Tuple[str, str], ...]] = None
    shared: bool = False  # it is of the same trial under the bare script

    @property
    def false_success(self) -> bool:
        """Whether the goal was met with another thing than the one that was meant."""
        return bool(self.wrong_object)


def read_truth(path: str) -> Dict[int, Truth]:
    """Read a truth file by seed. If a seed appears twice, the later line is used.

    A last line that was cut off in its writing is skipped.

    :raises BagError: for any other line that is wrong.
    :raises OSError: where the file cannot be read.
    """
    with open(path, encoding='utf-8') as source:
        lines = source.read().split('\n')
    torn = lines.pop()  # behind the last line's end: nothing, or what was being written
    found = [
        _parse(line, '{} line {}'.format(path, number))
        for number, line in enumerate(lines, 1)
        if line.strip()
    ]
    if torn.strip():
        found += _whole(torn)
    return {truth.seed: truth for truth in found}


def _whole(line: str) -> List[Truth]:
    """A line without an end, where nothing but its end is missing."""
    try:
        return [_parse(line, '')]
    except BagError:
        return []


def _parse(line: str, where: str) -> Truth:
    try:
        data = json.loads(line)
    except (ValueError, RecursionError) as err:
        raise BagError('{}: not JSON: {}'.format(where, err)) from err
    if not isinstance(data, dict):
        raise BagError('{}: not a JSON object'.format(where))
    later = {name: each for name, each in _LATER_FIELDS.items() if name in data}
    for name, (kinds, allowed) in {**_FIELDS, **later}.items():
        value = data.get(name)
        is_bool = isinstance(value, bool)
        if not isinstance(value, kinds) or (is_bool and bool not in kinds):
            raise BagError(
                '{}: {}: {!r} is not allowed; allowed: {}'.format(where, name, value, allowed)
            )
    return Truth(
        data['seed'],
        data['task'],
        data['success'],
        data['why'],
        _causes(data['causes'], where),
        float(data['sim_s']),
        float(data['wall_s']),
        _shares(data['share'], where),
        data.get('wrong_object', ''),
        _damage(data['damage'], where) if 'damage' in data else None,
        data.get(SHARED) is True,
    )


def _damage(by_kind: Mapping[str, Any], where: str) -> Tuple[Tuple[str, str], ...]:
    things = {kind: by_kind.get(kind, []) for kind in DAMAGE}
    if not all(isinstance(names, list) for names in things.values()):
        raise BagError(
            '{}: damage: {!r} is not allowed; allowed: lists of names by {}'.format(
                where, by_kind, ', '.join(DAMAGE)
            )
        )
    return tuple((kind, str(name)) for kind, names in things.items() for name in names)


def _causes(items: Iterable[Any], where: str) -> Tuple[Tuple[str, str], ...]:
    try:
        return tuple((str(item['kind']), str(item['text'])) for item in items)
    except (TypeError, KeyError) as err:
        raise BagError('{}: causes: each needs "kind" and "text"'.format(where)) from err


def _shares(share: Mapping[str, Any], where: str) -> Mapping[str, float]:
    try:
        return {str(name): float(value) for name, value in share.items()}
    except (TypeError, ValueError) as err:
        raise BagError(
            '{}: share: {!r} is not allowed; allowed: numbers by name'.format(where, share)
        ) from err


class TruthFiles:
    """Truth files by the folder that they lie in, each read once."""

    def __init__(self) -> None:
        self._read: Dict[str, Dict[int, Truth]] = {}

    def of(self, folder: str, seed: Optional[int]) -> Optional[Truth]:
        """Return the truth of the trial with that seed in that folder, None where there is none.

        :raises BagError: where the file cannot be used.
        """
        if seed is None:
            return None
        if folder not in self._read:
            path = os.path.join(folder, TRUTH_FILE)
            try:
                self._read[folder] = read_truth(path)
            except FileNotFoundError:
                self._read[folder] = {}
            except (OSError, UnicodeDecodeError) as err:
                raise BagError('{}: cannot be read: {}'.format(path, err)) from err
        return self._read[folder].get(seed)
