"""Texts for people keep the rules of doc/inside/style.md, and the rules find what they are for."""

import pytest
from house import ROOT, shown
from plain_words import (
    PAGES,
    STYLE,
    TERMS,
    Prose,
    checked_files,
    faults,
    faults_of,
    interface_prose,
    page_prose,
    python_prose,
)

LONG = ' '.join(['The machine goes on'] + ['and on'] * 16) + '.'
CHECKED_PAGES = [path for path in checked_files() if path.suffix in PAGES]
# words that made a reader stop, with the rule that sees them
STOPPED = [
    ('A program that is no ROS node has nobody to ask, and does so at once.', 'term'),
    ('Each goes over those above it.', 'term'),
    ('The cookie is none any more.', 'term'),
    ('Joints that nobody tells of stand at zero.', 'term'),
    ('No pickle is ever loaded, but for that of the viewer.', 'term'),
    ('Of two lines of one seed the later counts.', 'term'),
    ('What raises is not met.', 'inverted'),
    ('Of a state only running it would tell.', 'inverted'),
    ('Whoever still presses is refused.', 'inverted'),
    ('A lease runs out; the next front end takes it.', 'semicolon'),
    (LONG, 'long'),
]
UNDERSTOOD = [
    'A precondition that raises counts as not met.',
    'What should the robot do? Of 450 trials, 111 failed.',
    'If there is none, the priors are used.',
    'Run `a; b` and see "nothing; at all".',
    'Later rows override earlier ones.',
]


def rules_of(text):
    return {fault.rule for fault in faults(Prose(1, text, page=True))}


@pytest.mark.parametrize('text, rule', STOPPED, ids=lambda each: each[:30])
def test_a_rule_sees_what_made_a_reader_stop(text, rule):
    assert rule in rules_of(text)


@pytest.mark.parametrize('text', UNDERSTOOD, ids=lambda each: each[:30])
def test_no_rule_stops_at_plain_words(text):
    assert not rules_of(text)


def test_the_list_of_terms_is_there():
    rows = (ROOT / STYLE).read_text(encoding='utf-8').split('| write |')[1].splitlines()
    assert len(rows) > 30 and len(TERMS) > 25


def test_a_page_is_read_without_its_code_and_by_paragraphs():
    page = (
        '# Of a title\n\nOne line\nand one more.\n* a point\n\n```\ncode; more\n```\n| a | b; c |\n'
    )
    pieces = [(piece.line, piece.text, piece.table) for piece in page_prose(page)]
    assert pieces == [
        (3, 'One line and one more.', False),
        (5, '* a point', False),
        (10, '| a | b; c |', True),
    ]


def test_code_is_read_by_docstrings_comments_and_longer_strings():
    code = 'def f():\n    """Says what."""\n    # a comment\n    raise E("no such file as that")\n'
    assert {piece.text for piece in python_prose(code)} == {'# a comment', 'no such file as that'}
    comments = [piece.text for piece in interface_prose('# first\n# second\nint32 a  # third\n')]
    assert comments == ['first second', 'third']


@pytest.mark.parametrize('path', CHECKED_PAGES, ids=shown)
def test_a_page_keeps_the_rules(path):
    assert not faults_of(path)


def test_the_texts_in_the_code_keep_the_rules():
    found = {shown(path): faults_of(path) for path in checked_files() if path.suffix not in PAGES}
    assert len(found) > 300
    assert not {name: each for name, each in found.items() if each}
