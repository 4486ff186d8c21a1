"""doc/inside/architecture.md: its picture is drawn from the imports, its ways are there."""

import ast
import collections
import functools
import re
import subprocess
import sys

import pytest
from arrows import INSIDE, ROOMS, below, found, needs_engine, needs_ros, told
from house import ROOT, imports
from layers import LAYERS

SOURCES = ROOT / 'src/smach_oracle'
PAGE = (ROOT / 'doc/inside/architecture.md').read_text(encoding='utf-8')
PICTURE = ROOT / 'doc/images/rooms'
STEP = re.compile(r'^\| `([\w/.]+\.(?:py|js))` \| `(\w+)` \| (\w+) \|$', re.MULTILINE)

ROWS = dict(re.findall(r'^\| `(\w+)` \| [^|]+ \| ([^|]+) \|$', PAGE, re.MULTILINE))
# what the page means by a thing that a room must not know: does an import know it?
MEANINGS = {
    'ROS': lambda name: needs_ros(name) and not below(name, ['smach']),
    'SMACH': needs_engine,
    'numpy': lambda name: below(name, ['numpy']),
    'front ends': lambda name: below(name, ['smach_oracle.expert']),
    'the robot': lambda name: below(name, ['smach_oracle.pr2']),
    'the simulation': lambda name: below(name, ['smach_oracle.simulation']),
    "the executive's inside": lambda name: below(name, ['smach_oracle.' + each for each in INSIDE]),
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
    return [
        ast.get_source_segment(text, node)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and node.name == function
    ]


STEPS = [step for way in ways() for step in way]
PAIRS = [pair for way in ways() for pair in zip(way, way[1:])]


def text_of(name):
    """The text of a file."""
    return (SOURCES / name).read_text(encoding='utf-8')


def is_value(function, name):
    """Whether a file hands a function of its own on, instead of calling it."""
    if name.endswith('.js'):
        return bool(re.search(r'=> this\.%s\(' % function, text_of(name)))
    nodes = list(ast.walk(ast.parse(text_of(name))))
    called = {id(node.func) for node in nodes if isinstance(node, ast.Call)}
    return any(
        isinstance(node, (ast.Attribute, ast.Name))
        and id(node) not in called
        and function == getattr(node, 'attr', getattr(node, 'id', None))
        for node in nodes
    )


def types(name, folder):
    """The messages, services or actions whose parts a file imports."""
    parts = re.compile('(Action|Goal|Result|Feedback|Request|Response)+$')
    return {
        parts.sub('', alias.name)
        for node in ast.walk(ast.parse(text_of(name)))
        if isinstance(node, ast.ImportFrom) and (node.module or '').endswith('.' + folder)
        for alias in node.names
    } - {'Header'}


def calls(step, after):
    """Whether the step's function names the next."""
    return any(
        re.search(r'\b_?{}\b'.format(after[1].lstrip('_')), body) for body in bodies(*step[:2])
    )


@functools.lru_cache(maxsize=None)
def functions():
    """The functions of the page's Python files, as {(file, name): the names that they use}."""
    uses = collections.defaultdict(set)
    for name in {step[0] for step in STEPS if step[0].endswith('.py')}:
        tree = ast.parse(text_of(name))
        lists = {
            node.target.id: node.value
            for node in tree.body
            if isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Tuple)
        }
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                uses[name, node.name] |= {
                    inner.attr if isinstance(inner, ast.Attribute) else inner.func.id
                    for inner in ast.walk(node)
                    if isinstance(inner, ast.Attribute)
                    or isinstance(inner, ast.Call)
                    and isinstance(inner.func, ast.Name)
                }
                # a list of functions that it goes through
                uses[name, node.name] |= {
                    getattr(each, 'id', '')
                    for inner in ast.walk(node)
                    if isinstance(inner, ast.Name) and inner.id in lists
                    for each in lists[inner.id].elts
                }
    return uses


@functools.lru_cache(maxsize=None)
def knows(name, other):
    """Whether one file of the page imports something from another."""
    module = 'smach_oracle.' + other[: -len('.py')].replace('/', '.')
    return any(below(target, [module]) for _, target in imports(SOURCES / name))


def leads_to(place):
    """The functions that one calls: of its file, of those it imports, and those handed to it."""
    file, used = place[0], functions()[place]
    handed = {word.lstrip('_') for word in used}
    counts = collections.Counter(name for _, name in functions())
    for each in functions():
        if each[0] == file and each[1] in used:
            yield each
        # a port: where no import says which function it is, its name must
        if each[1] in handed and (knows(file, each[0]) or counts[each[1]] == 1):
            yield each


def returns(step, after):
    """Whether the next function leads to the step's own, by functions of the page's files."""
    reached, waiting = set(), [after[:2]]
    while waiting:
        place = waiting.pop()
        if place not in reached:
            reached.add(place)
            waiting += leads_to(place)
    return step[:2] in reached


def queued(step, after):
    """Whether the next function's file uses the class that the step's function puts into."""
    classes = [
        node.name
        for node in ast.parse(text_of(step[0])).body
        if isinstance(node, ast.ClassDef)
        and step[1] in {getattr(each, 'name', None) for each in node.body}
    ]
    return any(re.search(r'\b{}\('.format(name), text_of(after[0])) for name in classes)


def sent(step, after):
    """Whether one sends on a web socket, and the other is what a web socket calls."""
    return (
        after[1] == 'on_message'
        and 'WebSocketHandler' in text_of(after[0])
        and any('socket.send(' in body for body in bodies(*step[:2]))
    )


# how one function hands over to the next
WORDS = {
    'calls': calls,
    'list': lambda step, after: step[0] == after[0] and after[1] in functions()[step[:2]],
    'returns': returns,
    'callback': lambda step, after: is_value(after[1], after[0]),
    'observer': lambda step, after: is_value(after[1], after[0]),
    'thread': lambda step, after: is_value(after[1], step[0]),
    'queue': queued,
    'socket': sent,
    'topic': lambda step, after: (
        types(step[0], 'msg') & types(after[0], 'msg')
        and 'Publisher(' in text_of(step[0])
        and 'Subscriber(' in text_of(after[0])
    ),
    'service': lambda step, after: (
        types(step[0], 'srv') & types(after[0], 'srv') and is_value(after[1], after[0])
    ),
    'action': lambda step, after: (
        types(step[0], 'msg') & types(after[0], 'msg')
        and any('.set_succeeded(' in body for body in bodies(*step[:2]))
        and 'GoalLink(' in text_of(after[0])
    ),
    'expert': lambda step, after: is_value(after[1], after[0]),  # a command of the page's
}


def test_three_ways_are_told():
    assert len(ways()) == 4 and len(STEPS) > 50


@pytest.mark.parametrize('name, function, then', STEPS, ids=lambda value: value)
def test_a_step_is_there(name, function, then):
    assert bodies(name, function), '{} has no function {}'.format(name, function)


@pytest.mark.parametrize('step, after', PAIRS, ids=lambda step: '{}:{}'.format(*step))
def test_a_step_hands_over_to_the_next(step, after):
    assert WORDS[step[2]](step, after), '{}:{} {} {}:{}? It does not'.format(*step, *after[:2])


def test_each_way_ends():
    assert [way[-1][2] for way in ways()] == ['end'] * len(ways())


def test_the_picture_is_drawn_from_the_imports():
    drawn = subprocess.run(
        [sys.executable, str(ROOT / 'doc/draw_rooms.py'), '--print'],
        stdout=subprocess.PIPE,
        timeout=60,
        check=True,
    ).stdout.decode()
    assert PICTURE.with_suffix('.dot').read_text(encoding='utf-8') == drawn, (
        'draw it again: python3 doc/draw_rooms.py'
    )
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
        assert not told(
            (where, name) for where, name in found(room) if knows(name) and not below(name, own)
        ), what


def test_the_page_says_what_the_inside_is():
    (said,) = re.findall(r'^The executive\'s inside is (.*)\. ', PAGE, re.MULTILINE)
    assert {'oracle.' + name for name in re.findall('`(.*?)`', said)} == INSIDE


def test_the_executive_has_the_layers_of_the_page():
    table = PAGE[PAGE.index('Inside `oracle`') :].split('\n\n')[1]
    assert (
        re.findall(r'^\| `(\w+)(?:\.py)?` \|', table, re.MULTILINE) == LAYERS['smach_oracle.oracle']
    )
