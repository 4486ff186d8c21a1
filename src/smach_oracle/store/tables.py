"""The tables of a store, and how a new one is made: whole, or not at all."""

import contextlib
import os
import sqlite3

from .soundness import Content

FORMAT = 1
MAGIC = 0x534D4F53  # "SMOS": which program's file it is, where SQLite keeps that
BUSY_S = 5.0  # how long one process waits for another that writes
_SCHEMA = """
CREATE TABLE IF NOT EXISTS marked (since INTEGER);
CREATE TABLE IF NOT EXISTS structures (id TEXT PRIMARY KEY, description TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS trials (number INTEGER PRIMARY KEY, machine TEXT NOT NULL,
    trial_id TEXT NOT NULL UNIQUE, structure TEXT NOT NULL, begun REAL NOT NULL, ended REAL,
    outcome TEXT NOT NULL DEFAULT '');
CREATE INDEX IF NOT EXISTS trials_of ON trials (machine, number);
CREATE TABLE IF NOT EXISTS moments (number INTEGER PRIMARY KEY, trial INTEGER NOT NULL,
    at REAL NOT NULL, seq INTEGER NOT NULL, kind TEXT NOT NULL, path TEXT NOT NULL,
    label TEXT NOT NULL, after INTEGER);
CREATE INDEX IF NOT EXISTS moments_of ON moments (trial, number);
CREATE TABLE IF NOT EXISTS facts (moment INTEGER NOT NULL, path TEXT NOT NULL, name TEXT NOT NULL,
    text TEXT, whole BLOB);
CREATE INDEX IF NOT EXISTS facts_of ON facts (moment);
CREATE TABLE IF NOT EXISTS parts (digest BLOB PRIMARY KEY, data BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS log (number INTEGER PRIMARY KEY, at REAL NOT NULL, who TEXT NOT NULL,
    what TEXT NOT NULL);
"""


def connect(where: str) -> sqlite3.Connection:
    """Open a database, by its path or by a URI."""
    return sqlite3.connect(
        where,
        timeout=BUSY_S,
        isolation_level=None,
        check_same_thread=False,
        uri=where.startswith('file:'),
    )


def make_store(where: str) -> None:
    """Make a new store, unless another program has just done so.

    Its tables are on the disk before it has its name, and before a log is begun.

    :raises sqlite3.Error: where it cannot be written.
    """
    temporary = '{}-new-{}'.format(where, os.getpid())
    try:
        database = connect(temporary)
        try:
            make_tables(database)
        finally:
            database.close()
        with contextlib.suppress(FileExistsError):
            os.link(temporary, where)
    except OSError as err:
        raise sqlite3.OperationalError(str(err)) from err
    finally:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
    _sync_folder(os.path.dirname(where))


def _sync_folder(folder: str) -> None:
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def make_tables(database: sqlite3.Connection) -> None:
    """Make the tables that a database lacks. One that an earlier program has made lacks one.

    A store with the table `marked` has a mark, and no log once it is closed.
    """
    if _has_table(database, 'marked'):
        return
    with contextlib.suppress(sqlite3.OperationalError):  # such as where others have it open
        database.execute('PRAGMA journal_mode = DELETE')
    database.execute('BEGIN IMMEDIATE')
    for statement in _SCHEMA.split(';'):
        if statement.strip():
            database.execute(statement)
    database.execute('PRAGMA application_id = {}'.format(MAGIC))
    database.execute('PRAGMA user_version = {}'.format(FORMAT))
    database.execute('COMMIT')


def content_of(database: sqlite3.Connection) -> Content:
    """Return what a store has. One of which the tables are still to be made has nothing.

    :raises sqlite3.Error: where it cannot be read.
    """
    if not _has_table(database, 'moments'):
        return Content()
    return Content(
        *(
            int(database.execute('SELECT {}'.format(what)).fetchone()[0] or 0)
            for what in (
                'max(number) FROM moments',
                'max(number) FROM trials',
                'count(*) FROM trials WHERE ended IS NOT NULL',
            )
        )
    )


def needs_log(database: sqlite3.Connection) -> bool:
    """Whether a store of which a log should be there is not whole without it.

    Earlier programs left the same file behind as they closed it.
    """
    (tables,) = database.execute('SELECT count(*) FROM sqlite_master').fetchone()
    return not tables or _has_table(database, 'marked')


def _has_table(database: sqlite3.Connection, name: str) -> bool:
    return bool(
        database.execute('SELECT count(*) FROM sqlite_master WHERE name = ?', (name,)).fetchone()[0]
    )


def try_to_write(database: sqlite3.Connection) -> None:
    """Find out whether it can be written. It changes nothing."""
    database.execute('BEGIN IMMEDIATE')
    try:
        database.execute('PRAGMA user_version = {}'.format(FORMAT))
    finally:
        database.execute('ROLLBACK')
