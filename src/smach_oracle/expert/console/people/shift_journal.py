"""The file that keeps notes between shifts, and the times of answered questions.

A line of JSON each, which is on the disk before anybody is told so. A crash loses at most a line
that was being written. Several consoles may share a file.
"""

import contextlib
import errno
import fcntl
import json
import math
import os
import stat
import tempfile
import threading
import time
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple

from .answer_times import AnsweredQuestion

MOST_NOTES = 100
MOST_ANSWERED = 5000
LONGEST_NOTE = 2000
MOST_BYTES = 2 * 2**20  # of the file, above which it is written again with what is kept
_MOST_READ = 4 * MOST_BYTES
_LATEST_S = 1e11


class ShiftNote(NamedTuple):
    """A note for the next shift."""

    id: str
    at: float  # s since the epoch
    who: str
    text: str


class ShiftJournal:
    """The notes and the answered questions, kept in a file. Any thread may use it."""

    def __init__(self, path: str = '') -> None:
        """:param path: of the file, which is made with its folder. '': nothing is kept."""
        self.path = path
        self.problem = ''  # why what is there cannot be read
        self.version = 0  # grows with every change
        self._lock = threading.RLock()
        self._notes: Dict[str, ShiftNote] = {}
        self._answered: List[AnsweredQuestion] = []
        self._seen: Tuple[int, ...] = ()
        # the same for readers, who wait for no disk
        self._shown: Tuple[List[ShiftNote], List[AnsweredQuestion]] = ([], [])
        self.look()

    @property
    def notes(self) -> List[ShiftNote]:
        """Return the notes, newest first."""
        return self._shown[0]

    @property
    def answered(self) -> List[AnsweredQuestion]:
        """Return the answered questions."""
        return self._shown[1]

    def write_note(self, who: str, text: str) -> None:
        """Keep a note.

        :raises OSError: where it cannot be written. Then it is not kept.
        """
        name = '{:.6f}-{}'.format(time.time(), os.getpid())
        self._write({'note': name, 'at': time.time(), 'who': who, 'text': text[:LONGEST_NOTE]})

    def drop_note(self, note: str) -> bool:
        """Drop a note. Return whether there was one.

        :raises OSError: where that cannot be written. Then it stays.
        """
        with self._lock:
            if note not in self._notes:
                return False
            self._write({'drop': note})
            return True

    def add_answered(self, answered: AnsweredQuestion) -> None:
        """Keep the times of an answered question. It is kept in memory where the file fails."""
        record = {'answered': list(answered)}
        try:
            self._write(record)
        except OSError as err:
            with self._lock:
                self.problem = why_not(err)
                self._take(record)
                self._show()

    def look(self) -> None:
        """Read what another console has written meanwhile, or all at first."""
        if not self.path:
            return
        with self._lock:
            try:
                seen = _state_of(self.path)
                if seen == self._seen:
                    return
                self._read()
                self._seen, self.problem = seen, ''
            except FileNotFoundError:
                return
            except OSError as err:
                if self.problem == why_not(err):
                    return
                self.problem = why_not(err)
            self._show()

    def _write(self, record: Mapping[str, Any]) -> None:
        with self._lock:
            if self.path:
                with self._locked() as stream:
                    if os.fstat(stream.fileno()).st_size:
                        self.look()
                        text = _line(record)
                    else:  # somebody has taken the file away
                        text = self._text() + _line(record)
                    self._append(stream.fileno(), text)
                    self._seen = _state_of(self.path)
            self._take(record)
            self._show()
            if self.path and self._seen[2] > MOST_BYTES:
                self._write_again()

    @contextlib.contextmanager
    def _locked(self) -> Iterator[Any]:
        """The open file, which no other console writes meanwhile, nor replaces."""
        os.makedirs(os.path.dirname(self.path) or '.', exist_ok=True)
        while True:
            with open(self.path, 'ab', opener=_plain) as stream:
                fcntl.flock(stream, fcntl.LOCK_EX)
                try:
                    if _is_at(stream.fileno(), self.path):
                        yield stream
                        return
                finally:  # a child that was forked meanwhile would keep it
                    fcntl.flock(stream, fcntl.LOCK_UN)

    def _append(self, descriptor: int, text: bytes) -> None:
        """Write lines behind the others, behind one that was torn by a crash, too."""
        size = os.fstat(descriptor).st_size
        with open(self.path, 'rb', opener=_plain) as stream:
            stream.seek(max(0, size - 1))
            torn = stream.read(1) not in (b'', b'\n')
        text = (b'\n' if torn else b'') + text
        try:
            if os.write(descriptor, text) != len(text):
                raise OSError(errno.ENOSPC, 'the disk is full')
            os.fsync(descriptor)
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(descriptor, size)
            raise

    def _write_again(self) -> None:
        """Replace the file by one with what is kept."""
        with contextlib.suppress(OSError), self._locked():
            self._read()
            folder = os.path.dirname(self.path) or '.'
            descriptor, draft = tempfile.mkstemp(suffix='.tmp', dir=folder)
            try:
                with os.fdopen(descriptor, 'wb') as stream:
                    stream.write(self._text())
                    stream.flush()
                    os.fsync(stream.fileno())
                os.replace(draft, self.path)
            except BaseException:
                os.remove(draft)
                raise
            self._seen = _state_of(self.path)

    def _text(self) -> bytes:
        """Return the lines of all that is kept."""
        notes = [_line({'note': note.id, **note._asdict()}) for note in self._notes.values()]
        return b''.join(notes + [_line({'answered': list(each)}) for each in self._answered])

    def _read(self) -> None:
        """Take in the file as it is. A line that is no record of ours is passed over."""
        with open(self.path, 'rb', opener=_plain) as stream:
            stream.seek(max(0, os.fstat(stream.fileno()).st_size - _MOST_READ))
            lines = stream.read(_MOST_READ).split(b'\n')
        self._notes.clear()
        self._answered.clear()
        for line in lines:
            try:
                record = json.loads(line) if line else None
            except (ValueError, RecursionError):
                continue
            if isinstance(record, dict):
                self._take(record)

    def _show(self) -> None:
        newest = sorted(self._notes.values(), key=lambda note: note.at, reverse=True)
        self._shown = newest, list(self._answered)
        self.version += 1

    def _take(self, record: Mapping[str, Any]) -> None:
        if 'drop' in record:
            self._notes.pop(str(record['drop']), None)
        note, answered = _note(record), _answered(record)
        if note is not None:
            self._notes[note.id] = note
            while len(self._notes) > MOST_NOTES:
                del self._notes[min(self._notes, key=lambda each: self._notes[each].at)]
        if answered is not None:
            self._answered.append(answered)
            del self._answered[:-MOST_ANSWERED]


def _plain(path: str, flags: int) -> int:
    """Open a plain file, no pipe and no link. Nobody else may read it, as it has people's names.

    :raises OSError: for anything else.
    """
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, 'it is no plain file')
    return descriptor


def why_not(err: OSError) -> str:
    """Return the reason of an error of the file. It names no path: pages show it."""
    return 'The file of notes: {}'.format(err.strerror or type(err).__name__)


def _is_at(descriptor: int, path: str) -> bool:
    """Whether an open file is still the one of a path, and was not replaced."""
    try:
        return os.fstat(descriptor).st_ino == os.stat(path).st_ino
    except FileNotFoundError:
        return False


def _state_of(path: str) -> Tuple[int, ...]:
    found = os.stat(path)
    return found.st_ino, found.st_mtime_ns, found.st_size


def _line(record: Mapping[str, Any]) -> bytes:
    text = json.dumps(record, allow_nan=False, ensure_ascii=False)
    return text.encode('utf-8', 'replace') + b'\n'


def _note(record: Mapping[str, Any]) -> Optional[ShiftNote]:
    if not all(isinstance(record.get(key), str) for key in ('note', 'who', 'text')):
        return None
    at: Any = record.get('at')
    if not _is_time(at):
        return None
    return ShiftNote(record['note'][:80], at, record['who'][:100], record['text'][:LONGEST_NOTE])


def _answered(record: Mapping[str, Any]) -> Optional[AnsweredQuestion]:
    values = record.get('answered')
    if not isinstance(values, list) or len(values) != len(AnsweredQuestion._fields):
        return None
    at, who, claim_s, answer_s, resume_s = values
    spans = (claim_s, resume_s)
    if (
        not isinstance(who, str)
        or not _is_time(at)
        or not _is_time(answer_s)
        or not all(each is None or _is_time(each) for each in spans)
    ):
        return None
    return AnsweredQuestion(at, who[:100], claim_s, answer_s, resume_s)


def _is_time(value: object) -> bool:
    return (
        isinstance(value, (int, float))
        and not isinstance(value, bool)
        and math.isfinite(value)
        and 0 <= value <= _LATEST_S
    )
