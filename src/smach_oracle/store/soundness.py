"""Whether the files of a store are all there and belong together, before SQLite opens any.

SQLite takes a log that is lost for one that was never there, and an empty file for a new database.
Both would be a new trial where a machine had stood in the middle of one.
"""

import json
import os
import stat
import struct
from typing import Any, Dict, List, NamedTuple, Optional

from .errors import StoreDamaged, StoreError

LOG, JOURNAL, MARK = '-wal', '-journal', '-mark'
SET_ASIDE = '.damaged'
CLOSED = 'closed'  # in a mark, in place of a log
ACCEPT = '`oracle_state {} accept` goes on with what can still be read'
_HEAD = b'SQLite format 3\0'
_HEAD_BYTES, _LOG_HEAD_BYTES = 100, 32
_MODE = 18  # place in the head of what is 2 where a log follows
_LOG_MAGICS = (0x377F0682, 0x377F0683)
_LONGEST_MARK = 512  # bytes
_KINDS = (
    (stat.S_ISDIR, 'a folder'),
    (stat.S_ISFIFO, 'a pipe'),
    (stat.S_ISSOCK, 'a socket'),
    (stat.S_ISCHR, 'a device'),
    (stat.S_ISBLK, 'a device'),
)


class Content(NamedTuple):
    """What a store has: numbers of its last moment and trial, and how many trials have ended."""

    moment: int = 0
    trial: int = 0
    ended: int = 0


class Mark:
    """A small file next to a store that says what was committed to it last.

    It is written behind each commit, and never waits for the disk. So a store has at least what
    its mark says, except after a power cut where `synchronous` allows that.
    """

    def __init__(self, path: str, synchronous: str) -> None:
        """`path`: of the store's own file, no link."""
        self._path, self._synchronous = path, synchronous
        self._boot = _boot()
        self._log: Optional[int] = None
        self._descriptor: Optional[int] = None

    def write(self, content: Content, log: Optional[str] = None) -> None:
        """Note what the store has now. A disk that fails leaves an earlier mark.

        `log`: CLOSED where it has none, '' where one begins, by default the one that is there.
        """
        try:
            if self._descriptor is None:
                self._descriptor = os.open(
                    self._path + MARK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644
                )
            text = '{{"moment":{},"trial":{},"ended":{},"log":"{}","synchronous":"{}","boot":"{}"}}'
            told = (
                text.format(
                    *content, self._salts() if log is None else log, self._synchronous, self._boot
                ).ljust(_LONGEST_MARK - 1)
                + '\n'
            )
            os.pwrite(self._descriptor, told.encode('ascii'), 0)
        except OSError:
            pass

    def _salts(self) -> str:
        """Return the salts of the log, which SQLite changes with each new one."""
        if self._log is None:
            self._log = os.open(self._path + LOG, os.O_RDONLY | os.O_CLOEXEC)
        return os.pread(self._log, 8, 16).hex()

    def close(self) -> None:
        """Close it."""
        for each in (self._log, self._descriptor):
            if each is not None:
                os.close(each)
        self._log = self._descriptor = None


def read_mark(path: str) -> Optional[Dict[str, Any]]:
    """Return what the mark of a store says, None where there is none that can be read."""
    try:
        with open(path + MARK, 'rb') as stream:
            told = json.loads(stream.read(_LONGEST_MARK).decode('ascii'))
        Content(*(int(told[name]) for name in Content._fields))
        return dict(told, **{name: str(told[name]) for name in ('log', 'synchronous', 'boot')})
    except (OSError, ValueError, TypeError, LookupError):
        return None


def missed(mark: Dict[str, Any], content: Content) -> bool:
    """Whether a store lacks what its mark says that it has."""
    if mark['synchronous'] != 'FULL' and mark['boot'] != _boot():
        return False  # the computer has lost power since: that may have cost the last moments
    return any(has < mark[name] for name, has in content._asdict().items())


class Files(NamedTuple):
    """What the files of a store look like. `is_there`: False where a new one may be made."""

    is_there: bool
    lacks_log: bool = False  # although one follows its own file
    mark: Optional[Dict[str, Any]] = None


def examined(path: str, shown: str) -> Files:
    """Look at the files of a store, and change none.

    `path`: of its own file, no link. `shown`: how the user has named it.

    :raises StoreError: for what is no file.
    :raises StoreDamaged: where a part is missing, damaged or of another store.
    """
    found = _stat(path)
    if found is None or (stat.S_ISREG(found.st_mode) and not found.st_size):
        _check_nothing_is_left(path, shown, found is not None)
        return Files(False)
    for is_kind, kind in _KINDS:
        if is_kind(found.st_mode):
            raise StoreError(
                '{}: unable to open it: it is {}, no store. Name a file'.format(shown, kind)
            )
    try:
        head = _start(path, _HEAD_BYTES)
    except OSError as err:
        raise StoreError('{}: cannot be read: {}'.format(shown, err)) from err
    if len(head) < _HEAD_BYTES or not head.startswith(_HEAD):
        raise StoreDamaged(
            '{}: is damaged, or no store: it does not begin as an SQLite file. Put '
            'it back from a copy, with the files next to it'.format(shown)
        )
    mark = read_mark(path)
    follows = head[_MODE] == 2
    has_log = _size(path + LOG) >= _LOG_HEAD_BYTES
    if mark and follows and mark['log'] == CLOSED and (has_log or mark['boot'] == _boot()):
        mark = None  # of a store that was there before, unless a power cut has cost the later ones
    if has_log:
        _check_log(path, shown, follows, mark)
    return Files(True, follows and not has_log, mark)


def _check_nothing_is_left(path: str, shown: str, is_empty: bool) -> None:
    left = [shown + word for word in (LOG, JOURNAL, MARK) if (_size(path + word))]
    if is_empty:
        left.append(shown)
    if left:
        raise StoreDamaged(
            '{}: is {}{}, so a store was here. Put it back from a copy. To begin '
            'a new one, remove {}'.format(
                shown,
                'empty' if is_empty else 'missing',
                '' if is_empty else ', and {} is there'.format(left[0]),
                ' and '.join(left),
            )
        )


def _check_log(path: str, shown: str, follows: bool, mark: Optional[Dict[str, Any]]) -> None:
    head = _start(path + LOG, _LOG_HEAD_BYTES)
    (magic,) = struct.unpack_from('>I', head)
    if magic not in _LOG_MAGICS or _sums(head[:24], magic) != struct.unpack_from('>II', head, 24):
        raise StoreDamaged(
            '{0}: its log, {0}{1}, is damaged, and with it the latest moments. Put '
            'it back from a copy. {2}'.format(shown, LOG, ACCEPT.format(shown))
        )
    if not follows or (mark and mark['log'] and not _is_of(head[16:24], mark['log'])):
        raise StoreDamaged(
            '{0}: the log {0}{1} is not its own. Put back the one that was there. {2}'.format(
                shown, LOG, ACCEPT.format(shown)
            )
        )


def _is_of(salts: bytes, known: str) -> bool:
    """Whether a log is the known one, or that with which SQLite has gone on behind it."""
    before = bytes.fromhex(known)
    number = struct.unpack_from('>I', before)[0] if len(before) == 8 else 0
    return salts == before or struct.unpack_from('>I', salts)[0] == (number + 1) % (1 << 32)


def _sums(data: bytes, magic: int) -> Any:
    one = two = 0
    words: List[int] = list(struct.unpack('{}6I'.format('>' if magic & 1 else '<'), data))
    for first, second in zip(words[::2], words[1::2]):
        one = (one + first + two) & 0xFFFFFFFF
        two = (two + second + one) & 0xFFFFFFFF
    return one, two


def set_log_aside(path: str) -> None:
    """Keep a log that cannot be used under another name.

    :raises OSError: where that cannot be done.
    """
    os.replace(path + LOG, path + LOG + SET_ASIDE)


def _stat(path: str) -> Optional[os.stat_result]:
    try:
        return os.stat(path)
    except OSError:
        return None


def _size(path: str) -> int:
    found = _stat(path)
    return 0 if found is None else found.st_size


def _start(path: str, count: int) -> bytes:
    with open(path, 'rb') as stream:
        return stream.read(count)


def _boot() -> str:
    try:
        with open('/proc/sys/kernel/random/boot_id', encoding='ascii') as stream:
            return stream.read(64).strip()
    except OSError:
        return ''
