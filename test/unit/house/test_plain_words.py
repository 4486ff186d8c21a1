"""Texts for people keep the rules of doc/inside/style.md, and the rules find what they are for."""

import inspect
import subprocess
import sys
from collections import Counter

import plain_words
import pytest
from few_phrases import may_have, with_few_forms, with_few_phrases
from house import ROOT
from plain_words import (
    INTERFACES,
    STYLE,
    TERMS,
    Prose,
    checked_files,
    faults,
    interface_prose,
    page_prose,
    python_prose,
)
from proselint import tools

LONG = ' '.join(['The machine goes on'] + ['and on'] * 16) + '.'
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


# a fault of each kind of file, in what the rules read of it
FAULTY = [
    ('page.md', 'A lease runs out; the next front end takes it.\n', 'semicolon'),
    ('page.rst', 'Each goes over those above it.\n', 'term'),
    ('page.md', 'It is very unique.\n', 'uncomparables.misc'),
    ('code.py', '# The cookie is none any more\n', 'term'),
    ('code.py', '# Each GOES OVER those above\n', 'term'),
    ('code.py', 'TEXT = "each goes " \\\n    "over those above"\n', 'term'),
    ('Each.msg', '# each goes over those\n# above it\nint32 a\n', 'term'),
]


def test_the_check_fails_by_a_fault_in_each_kind_of_file(tmp_path):
    """`scripts/test lint words` looks at all files; these tests do not once more."""
    paths = [tmp_path / str(number) / each[0] for number, each in enumerate(FAULTY)]
    for path, (_, text, _) in zip(paths, FAULTY):
        path.parent.mkdir()
        path.write_text(text)
    done = subprocess.run(
        [sys.executable, plain_words.__file__, *map(str, paths)],
        stdout=subprocess.PIPE,
        check=False,
        timeout=120,
    )
    assert done.returncode == 1
    for path, (_, _, rule) in zip(paths, FAULTY):
        assert '{}:1: {}'.format(path, rule) in done.stdout.decode()


def test_the_check_looks_at_pages_code_and_interfaces():
    counted = Counter(path.suffix for path in checked_files())
    assert counted['.md'] > 50 and counted['.rst'] and counted['.py'] > 1500
    assert all(counted[suffix] > 3 for suffix in INTERFACES)


@pytest.mark.parametrize('phrase', ['Irregardless', 'proven ſtrategies', 'the \u212aing of'])
def test_letters_that_count_as_ascii_are_taken_for_it(phrase):
    assert may_have(phrase, phrase.replace('ſ', 's').replace('\u212a', 'k').lower())


def test_with_few_phrases_proselint_finds_what_it_finds_with_all():
    text = ' At the end of the day, it is Irregardless of a free gift; cafe, ATM machine. '
    phrases = ['at the end of the day', 'cafe[s]?', 'free gift', 'not there', 'irregardless']
    forms = [['café', ['cafe', 'caffe']], ['ATM', ['ATM machine']], ['regardless', ['irregardl']]]
    for check, few, wanted in (
        (tools.existence_check, with_few_phrases, phrases),
        (tools.preferred_forms_check, with_few_forms, forms),
    ):
        check = inspect.unwrap(check)
        found = check(text, wanted, 'rule', 'not {}')
        assert len(found) > 1 and few(check)(text, wanted, 'rule', 'not {}') == found
        assert few(check)(text, [], 'rule', 'not {}') == []
