"""The people who look at each question, sent to all pages. Only the sockets' thread calls it."""

from typing import Dict, List, NamedTuple

from ..shapes.basics import ByKey
from ..shapes.questions import OnlookerView
from ..web.audit import Person
from ..web.sections import PageSections

SECTION = 'onlookers'


class Onlooker(NamedTuple):
    """A page that shows a question."""

    question: str  # its key
    person: Person


class Onlookers:
    """Keeps the section up to date."""

    def __init__(self, sections: PageSections) -> None:
        self._sections = sections
        self._by_page: Dict[int, Onlooker] = {}

    def look(self, page: int, question: str, person: Person) -> None:
        """A page shows a question from now on, or '' for none."""
        if question:
            self._by_page[page] = Onlooker(question, person)
            self._write()
        else:
            self.leave(page)

    def rename(self, page: int, person: Person) -> None:
        """The person at a page has said a name."""
        if page in self._by_page:
            self.look(page, self._by_page[page].question, person)

    def leave(self, page: int) -> None:
        """A page is gone, or shows no question."""
        if self._by_page.pop(page, None) is not None:
            self._write()

    def _write(self) -> None:
        by_question: ByKey[List[OnlookerView]] = {}
        for _, (question, person) in sorted(self._by_page.items()):
            by_question.setdefault(question, []).append(
                {'name': person.expert, 'role': person.role, 'session': person.session}
            )
        self._sections.put(SECTION, by_question)
