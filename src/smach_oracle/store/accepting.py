"""A damaged store that somebody accepts: what its lost moments may have told is in doubt.

Each of its trials that has not ended gets a moment BROKEN. A trial may be lost as a whole, too. So
the store keeps the number behind which new ones begin: a machine without a later trial is in doubt.
The trials that go on get numbers behind it. A machine is then asked about its trial alone.
"""

import os
import sqlite3
import time

from .errors import StoreDamaged, StoreError
from .holding import check_nobody_holds
from .names import BROKEN
from .soundness import CLOSED, LOG, SET_ASIDE, Content, Mark, examined, read_mark, set_log_aside

WHAT = 'accepted although it had lost some of it: what has run since then is in doubt'
_NO_STORE_HAS = 1 << 62  # moments


def prepare(where: str, path: str) -> None:
    """Make the files of a damaged store ready to be opened. It looks damaged until it is accepted.

    `where`: its own file. `path`: as the user has named it.

    :raises StoreDamaged: where no store can be read.
    :raises StoreError: where a program holds a machine of it, or its log cannot be set aside.
    """
    check_nobody_holds(where, path)
    mark, is_log_bad = read_mark(where), False
    try:
        examined(where, path)
    except StoreDamaged:
        if not os.path.exists(where + LOG):
            raise
        is_log_bad = True
    known = mark or {'trial': 0, 'ended': 0, 'log': CLOSED}
    unfinished = Mark(where, 'FULL')
    unfinished.write(
        Content(_NO_STORE_HAS, known['trial'], known['ended']),
        log='' if known['log'] == CLOSED else known['log'],
    )
    unfinished.close()
    if is_log_bad:
        try:
            set_log_aside(where)
        except OSError as err:
            raise StoreError(
                '{0}: its log cannot be kept as {0}{1}{2}: {3}. Mend that, and accept '
                'the store again'.format(path, LOG, SET_ASIDE, err.strerror)
            ) from err


def put_in_doubt(database: sqlite3.Connection, who: str) -> None:
    """Note that moments and trials may be missing.

    :raises sqlite3.Error: where it cannot be written.
    """
    now = time.time()
    database.execute('BEGIN IMMEDIATE')
    database.execute(
        'INSERT INTO moments (trial, at, seq, kind, path, label) SELECT number, ?, '
        '(SELECT coalesce(max(seq), -1) FROM moments WHERE trial = trials.number), '
        "?, machine, '' FROM trials WHERE ended IS NULL",
        (now, BROKEN),
    )
    (since,) = database.execute('SELECT coalesce(max(number), 0) FROM trials').fetchone()
    database.execute('INSERT INTO marked VALUES (?)', (since,))
    going_on = (
        '(SELECT number FROM trials WHERE ended IS NULL AND number IN '
        '(SELECT max(number) FROM trials GROUP BY machine))'
    )
    database.execute('UPDATE moments SET trial = trial + ? WHERE trial IN ' + going_on, (since,))
    database.execute('UPDATE trials SET number = number + ? WHERE number IN ' + going_on, (since,))
    database.execute('INSERT INTO log (at, who, what) VALUES (?, ?, ?)', (now, who, WHAT))
    database.execute('COMMIT')
