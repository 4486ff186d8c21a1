"""Long lists of the page: of each only what has changed is sent, and only to pages that look.

A list is a section with rows, each with an id.
"""

import json
import threading
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

# each list, with the name that its rows have
LISTS = {'trials': 'trials', 'bags': 'trials', 'acts': 'acts'}
# what a page looks at, with the lists that it gets then
LOOKED_AT: Mapping[str, Tuple[str, ...]] = {'trials': ('trials', 'bags'), 'people': ('acts',)}


class RowList(NamedTuple):
    """A list as it is now."""

    rest: str  # JSON of what is beside the rows
    rows: Dict[str, str]  # JSON of each, by id, in their order


class RowLists:
    """Lists of rows. Any thread writes them, and the thread that serves the pages reads them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lists: Dict[str, RowList] = {}

    def put(self, name: str, data: Dict[str, Any]) -> None:
        """Set a list to plain data without NaN."""
        rest = {key: value for key, value in data.items() if key != LISTS[name]}
        rows = {row['id']: _text(row) for row in data[LISTS[name]]}
        with self._lock:
            self._lists[name] = RowList(_text(rest), rows)

    def get(self, name: str) -> Any:
        """Return a list as it is now, None where there is none."""
        found = self.now().get(name)
        return found and dict(
            json.loads(found.rest), **{LISTS[name]: list(map(json.loads, found.rows.values()))}
        )

    def now(self) -> Dict[str, RowList]:
        """Return all lists as they are now."""
        with self._lock:
            return dict(self._lists)


class SentLists:
    """The rows of the lists that one page has."""

    def __init__(self) -> None:
        self.looks: Tuple[str, ...] = ()  # names of the lists of which it is to get more
        self._sent: Dict[str, Optional[RowList]] = {}

    def changes(self, lists: RowLists) -> str:
        """JSON of what the page lacks, or '' where that is nothing, or it does not look."""
        if not self.looks:
            return ''
        parts = []
        now = lists.now()
        for name in self.looks:
            found = now.get(name)
            if found is None:
                # the page may have one of an earlier connection
                change = '' if name in self._sent else 'null'
            else:
                change = _change(self._sent.get(name), found)
            if change:
                self._sent[name] = found
                parts.append('{}:{}'.format(_text(name), change))
        return '{%s}' % ','.join(parts) if parts else ''


def _change(old: Optional[RowList], new: RowList) -> str:
    if old is None or _moved(old.rows, new.rows):
        return _change_text(True, new.rest, _placed(new.rows, new.rows), [])
    if old == new:
        return ''
    changed = {key: row for key, row in new.rows.items() if old.rows.get(key) != row}
    return _change_text(
        False,
        None if old.rest == new.rest else new.rest,
        _placed(changed, new.rows),
        [key for key in old.rows if key not in new.rows],
    )


def _moved(old: Dict[str, str], new: Dict[str, str]) -> bool:
    """Whether those that stay have changed places."""
    return [key for key in old if key in new] != [key for key in new if key in old]


def _placed(changed: Dict[str, str], rows: Dict[str, str]) -> List[Tuple[str, str]]:
    """Each of the changed rows with the id of the one before it, or '' for the first."""
    before = dict(zip(rows, ['', *rows]))
    return [(before[key], row) for key, row in changed.items()]


def _change_text(
    whole: bool, rest: Optional[str], rows: Sequence[Tuple[str, str]], gone: List[str]
) -> str:
    parts = [
        '"rows":[{}]'.format(','.join('[{},{}]'.format(_text(before), row) for before, row in rows))
    ]
    if whole:
        parts.append('"all":true')
    if rest is not None:
        parts.append('"rest":' + rest)
    if gone:
        parts.append('"gone":' + _text(gone))
    return '{%s}' % ','.join(parts)


def _text(data: object) -> str:
    return json.dumps(data, allow_nan=False, separators=(',', ':'))
