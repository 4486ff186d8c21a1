"""doc/architecture.md: its picture is drawn from the imports, its ways are there."""
import ast
import re
import subprocess
import sys

import pytest
from arrows import INSIDE, ROOMS, below, found, needs_engine, needs_ros, told
from house import ROOT

SOURCES = ROOT / 'src/smach_oracle'
PAGE = (ROOT / 'doc/architecture.md').read_text(encoding='utf-8')
PICTURE = ROOT / 'doc/images/rooms'
STEP = re.compile(r'^\| `([\w/.]+\.(?:py|js))` \| `(\w+)` \| (\w+) \|$', re.MULTILINE)
# how one function hands over to the next without naming it
BORDERS = {'observer', 'queue', 'callback', 'socket', 'thread', 'service', 'action', 'topic',
           'returns', 'end'}

ROWS = dict(re.findall(r'^\| `(\w+)` \| [^|]+ \| ([^|]+) \|$', PAGE, re.MULTILINE))
# what the page means by a thing that a room must not know: does an import know it?
MEANINGS = {
    'ROS': lambda name: needs_ros(name) and not below(name, ['smach']),
    'SMACH': needs_engine,
    'numpy': lambda name: below(name, ['numpy']),
    'front ends': lambda name: below(name, ['smach_oracle.expert']),
    'the robot': lambda name: below(name, ['smach_oracle.pr2']),
    'the simulation': lambda name: below(name, ['smach_oracle.simulation']),
    'the executive\'s inside': lambda name: below(name, ['smach_oracle.' + each
                                                         for each in INSIDE]),
    'other rooms': lambda name: below(name, ['smach_oracle.' + each for each in ROOMS]),
}


def ways():
    """The tables of steps, one list for each."""
    tables = re.split(r'^\|---\|---\|---\|$', PAGE, flags=re.MULTILINE)[1:]
    return [found for found in (STEP.findall(table.split('\n\n')[0]) for table in tables) if found]


def bodies(name, function):
    """The texts of all functions of this name in a file."""
    text = (SOURCES / name).read_text(encoding='utf-8')
    if name.endswith('.js'):
        found = re.findall(r'^  (?:async )?%s\(.*?^  }$' % function, text, re.MULTILINE | re.DOTALL)
        return found
    return [ast.get_source_segment(text, node) for node in ast.walk(ast.parse(text))
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and node.name == function]


STEPS = [step for way in ways() for step in way]
CALLS = [(way[at], way[at + 1]) for way in ways() for at in range(len(way) - 1)
         if way[at][2] == 'calls']


def test_three_ways_are_told():
    assert len(ways()) == 4 and len(STEPS) > 50


@pytest.mark.parametrize('name, function, then', STEPS, ids=lambda value: value)
def test_a_step_is_there(name, function, then):
    assert bodies(name, function), '{} has no function {}'.format(name, function)
    assert then == 'calls' or then in BORDERS


@pytest.mark.parametrize('step, after', CALLS, ids=lambda step: '{}:{}'.format(*step))
def test_a_step_calls_the_next(step, after):
    assert any(re.search(r'\b{}\b'.format(after[1]), body) for body in bodies(*step[:2])), \
        '{}:{} does not call {}'.format(step[0], step[1], after[1])


def test_each_way_ends():
    assert [way[-1][2] for way in ways()] == ['end'] * len(ways())


def test_the_picture_is_drawn_from_the_imports():
    drawn = subprocess.run([sys.executable, str(ROOT / 'doc/draw_rooms.py'), '--print'],
                           stdout=subprocess.PIPE, timeout=60, check=True).stdout.decode()
    assert PICTURE.with_suffix('.dot').read_text(encoding='utf-8') == drawn, \
        'draw it again: python3 doc/draw_rooms.py'
    shown = PICTURE.with_suffix('.svg').read_text(encoding='utf-8')
    arrows = re.findall(r'^  (\w+) -> (\w+);$', drawn, re.MULTILINE)
    titles = set(re.findall(r'<title>(\w+)&#45;&gt;(\w+)</title>', shown))
    assert arrows and titles == set(arrows)


def test_every_room_is_on_the_page():
    assert sorted(ROWS) == ROOMS


@pytest.mark.parametrize('room', ROOMS)
def test_a_room_does_not_know_what_the_page_says(room):
    own = ['smach_oracle.' + room]
    for what in ROWS[room].split(', '):
        knows = MEANINGS[what]
        assert not told((where, name) for where, name in found(room)
                        if knows(name) and not below(name, own)), what


def test_the_page_says_what_the_inside_is():
    said, = re.findall(r'^The executive\'s inside is (.*)\. ', PAGE, re.MULTILINE)
    assert {'oracle.' + name for name in re.findall('`(.*?)`', said)} == INSIDE
