"""The content of the pages, in named sections. Pure.

A section is sent whole when it has changed, its newest version only.
"""

import json
import threading
from typing import Any, Dict, List, NamedTuple, Tuple

from .row_lists import LISTS, RowLists

_MOST_GONE = 2000  # that are remembered, for pages that do not know yet


class _PageSection(NamedTuple):
    version: int
    text: str  # JSON. 'null' for one that is gone


class PageSections:
    """Sections of the page. Any thread writes them, the thread that serves the pages reads them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sections: Dict[str, _PageSection] = {}
        self._version = 0
        self.lists = RowLists()  # sections of another kind: each goes to the pages that look

    @property
    def version(self) -> int:
        """Return a number that grows with every change."""
        return self._version

    def put(self, name: str, data: object) -> None:
        """Set a section to plain data without NaN. None takes it away."""
        if name in LISTS and isinstance(data, dict):
            self.lists.put(name, data)
            return
        text = json.dumps(data, allow_nan=False, separators=(',', ':'))
        with self._lock:
            old = self._sections.get(name)
            if text == (old.text if old else 'null'):
                return
            self._version += 1
            self._sections[name] = _PageSection(self._version, text)
            if text == 'null':
                self._forget_gone()

    def get(self, name: str) -> Any:
        """Return a section as it is now, None where there is none."""
        if name in LISTS:
            return self.lists.get(name)
        section = self._sections.get(name)
        return json.loads(section.text) if section else None

    def since(self, version: int) -> Tuple[int, List[Tuple[str, str]]]:
        """The version now, and the sections that have changed since an earlier one (first: 0).

        :returns: each section's name and JSON.
        """
        with self._lock:
            changed = [
                (name, section.text)
                for name, section in self._sections.items()
                if section.version > version and (version or section.text != 'null')
            ]
            return self._version, changed

    def _forget_gone(self) -> None:
        """Forget some of very many that are gone, with the lock held."""
        gone = [name for name, section in self._sections.items() if section.text == 'null']
        if len(gone) > _MOST_GONE:
            for name in sorted(gone, key=lambda each: self._sections[each].version)[
                : _MOST_GONE // 2
            ]:
                del self._sections[name]
