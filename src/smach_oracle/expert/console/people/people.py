"""The panel of people: its sections, and its commands."""

import threading
import time
from collections import deque
from typing import Deque

from smach_oracle.oracle.records.events import Event

from ..commands.commands import CommandReply, PageCommand
from ..shapes.people import ActOverviewView, PeopleView
from ..web.audit import Audit, Person
from ..web.sections import PageSections
from ..web.shifts import Shifts
from .acts import Acts
from .answer_times import AnsweredQuestion, AnswerTimes
from .shift_journal import MOST_ANSWERED, ShiftJournal, why_not
from .shift_rows import shift_rows


class People:
    """What people did, how long it took them, and their notes. ROS threads feed it."""

    def __init__(self, journal: ShiftJournal, shifts: Shifts, audit: Audit) -> None:
        self._journal, self._shifts, self._audit = journal, shifts, audit
        self._times = AnswerTimes()
        self._lock = threading.Lock()  # of the times
        self._waiting: Deque[AnsweredQuestion] = deque(maxlen=MOST_ANSWERED)
        self._since = round(time.time(), 1)
        self.acts = Acts()
        self._acts_version = -1
        self._version = -1

    def take_event(self, event: Event) -> None:
        """Take in an event of any robot. It waits for no disk."""
        with self._lock:
            answered = self._times.add(event)
        if answered is not None:
            self._waiting.append(answered)

    def keep(self) -> None:
        """Write what waits, and read what other consoles have written. One thread calls it."""
        while self._waiting:
            self._journal.add_answered(self._waiting.popleft())
        self._journal.look()

    def carry_out(self, command: PageCommand, person: Person, page: int) -> CommandReply:
        """Write or drop a note, and record it."""
        try:
            if command.name == 'write_note':
                self._journal.write_note(person.expert, command.arguments['text'])
                reply = CommandReply(True, '')
            elif self._journal.drop_note(command.arguments['note']):
                reply = CommandReply(True, '')
            else:
                reply = CommandReply(False, 'This note is there no longer.')
        except OSError as err:
            reply = CommandReply(False, 'Not done. {}'.format(why_not(err)))
        self._audit.record(person, command.name, reply.ok, reply.message, command.arguments)
        return reply

    def write_sections(self, sections: PageSections) -> None:
        """Bring the sections up to date. One thread calls it."""
        if self.acts.version != self._acts_version:
            self._acts_version = self.acts.version
            overview: ActOverviewView = {'acts': self.acts.rows()}
            sections.put('acts', overview)
        if self._journal.version != self._version:
            self._version = self._journal.version
            sections.put('people', self._view())

    def _view(self) -> PeopleView:
        journal = self._journal
        return {
            'since': self._since,
            'kept': bool(journal.path),
            'problem': journal.problem[:300],
            'notes': [
                {'id': note.id, 'at': note.at, 'who': note.who, 'text': note.text}
                for note in journal.notes
            ],
            'shifts': shift_rows(journal.answered, self._shifts),
        }
