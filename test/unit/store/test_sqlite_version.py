"""The store needs no newer SQLite than that of ROS Noetic: 3.31, with Ubuntu 20.04."""

import ast
import re
import sqlite3
from pathlib import Path

import smach_oracle.store

# words and functions by the version of SQLite that brought them
LATER = re.compile(
    r'\bRETURNING\b|\bSTRICT\b|\bMATERIALIZED\b|\bDROP COLUMN\b|\bUPDATE\b.*\bFROM\b|->|'
    r'\b(iif|unixepoch|format|concat|timediff|octet_length|string_agg|sign|math\w*)\(|'
    r'\b(RIGHT|FULL) (OUTER )?JOIN\b|\bIS (NOT )?DISTINCT FROM\b|\bgenerate_series\b',
    re.IGNORECASE,
)
SQL = re.compile(
    r'^\s*(SELECT|INSERT|UPDATE|DELETE|CREATE|PRAGMA|BEGIN|COMMIT|ROLLBACK|VACUUM|'
    r'ALTER|DROP|WITH|REPLACE)\b'
)


def statements():
    """Return all SQL of the store, as (file, text)."""
    folder = Path(smach_oracle.store.__file__).parent
    return [
        (path.name, node.value)
        for path in sorted(folder.glob('*.py'))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and SQL.match(node.value)
    ]


def test_its_statements_are_known_to_the_sqlite_of_noetic():
    found = statements()
    assert len(found) > 20
    assert not [(name, text) for name, text in found if LATER.search(text)]


def test_later_syntax_would_be_found():
    for text in (
        'INSERT INTO a VALUES (1) RETURNING b',
        'CREATE TABLE a (b TEXT) STRICT',
        "SELECT a->'$.b' FROM c",
        'SELECT iif(a, b, c) FROM d',
        'ALTER TABLE a DROP COLUMN b',
        'SELECT * FROM a FULL JOIN b',
    ):
        assert SQL.match(text) and LATER.search(text)


def test_this_python_has_a_sqlite_that_is_new_enough():
    assert sqlite3.sqlite_version_info >= (3, 31)
