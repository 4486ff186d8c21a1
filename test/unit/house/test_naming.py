"""One name for one thing, one thing for one name."""

import ast
import collections
import re

from house import ROOT, nodes, parse, python_files, shown

PACKAGE = python_files('src/smach_oracle', 'src/smach_common')
# the one in ros/ extends the bare one of the executive, and stands for it in ROS programs
SHARED = {'OracleContainer'}
(STATIC,) = (path.parent for path in (ROOT / 'src').rglob('static/index.html'))
SCRIPTS = sorted((STATIC / 'js').rglob('*.js'))
# a class, or a function of a module or a class
IN_SCRIPT = re.compile(
    r'^(?:export )?(?:async )?(?:function|class) (\w+)|^  (?:async |get |set |static )*(\w+)\(',
    re.MULTILINE,
)
# names that do not say what a thing is
VAGUE = {
    'quicken',
    'Face',
    'Desk',
    'Office',
    'Eye',
    'Hands',
    'Tally',
    'standing',
    'course',
    'settling',
    'Thing',
    'Item',
    'Given',
    'Kept',
    'Freshness',
    'tend',
    'lap',
    'apart',
    'who',
    'letting_be',
}
VAGUE_SECTIONS = {'eye', 'hand', 'output', 'stills', 'conditions'}


def definitions(paths=PACKAGE):
    """Every class and function of these files, as (file, node)."""
    kinds = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return [(path, node) for path in paths for node in nodes(path) if isinstance(node, kinds)]


def names_in_script(path):
    """The classes and functions that a script defines; calls at its margin may be among them."""
    found = IN_SCRIPT.findall(path.read_text(encoding='utf-8'))
    return [function or method for function, method in found]


def test_a_class_name_occurs_once():
    places = collections.defaultdict(list)
    for path, node in definitions(python_files('src')):
        if isinstance(node, ast.ClassDef):
            places[node.name.lstrip('_')].append('{}:{}'.format(shown(path), node.lineno))
    assert not {
        name: found for name, found in places.items() if len(found) > 1 and name not in SHARED
    }


def test_nothing_has_a_name_that_does_not_say_what_it_is():
    vague = {name.lower() for name in VAGUE}
    found = [
        '{}:{} {}'.format(shown(path), node.lineno, node.name)
        for path, node in definitions()
        if node.name.lstrip('_') in VAGUE
        or isinstance(node, ast.ClassDef)
        and node.name.lstrip('_').lower() in vague
    ]
    found += [shown(path) for path in PACKAGE + SCRIPTS if path.stem in vague]
    found += [
        '{} {}'.format(shown(path), name)
        for path in SCRIPTS
        for name in names_in_script(path)
        if name in VAGUE
    ]
    assert not found


def test_the_names_in_scripts_are_found():
    names = {name for path in SCRIPTS for name in names_in_script(path)}
    assert len(names) > 400 and {'SensorFeed', 'counted', 'startRobot', 'stop'} <= names


def test_every_section_of_the_page_says_what_it_holds():
    text = (STATIC / 'js/server.d.ts').read_text(encoding='utf-8')
    sections = text.split('export interface Sections {')[1].split('\n}')[0]
    names = set(re.findall(r'^  (\w+):', sections, re.MULTILINE))
    assert {'questions', 'sensors', 'preconditions'} <= names
    assert not names & VAGUE_SECTIONS


def test_errors_are_documented_in_one_style():
    loose = re.compile(r'(?:^|[.;] )[Rr]aises \w*(?:Error|Exception)', re.MULTILINE)
    wrong = [
        '{}:{}'.format(shown(path), node.lineno)
        for path, node in definitions()
        if loose.search(ast.get_docstring(node) or '')
    ]
    assert not wrong, 'write a line of its own, `:raises X: when`'


# openings that say nothing: the thing itself is the better subject, or what it does
EMPTY = re.compile(
    r'The (?:part|parts|thing|things|data) (?:that|which|of which)\b'
    r'|Returns? (?:by|of|in) '
    # a fragment without a subject and a verb
    r'|(?:As|By|For|How|In|Of|That|Those|Where|Which|With|Without) '
)


def documented():
    """Every module, class and function with a docstring, as (place, node, docstring)."""
    found = [(path, parse(path)) for path in PACKAGE] + definitions()
    return [
        ('{}:{}'.format(shown(path), getattr(node, 'lineno', 1)), node, ast.get_docstring(node))
        for path, node in found
        if ast.get_docstring(node)
    ]


def test_a_docstring_begins_with_what_the_thing_is_or_does():
    assert not [
        '{} {}'.format(place, text.split('\n')[0])
        for place, _, text in documented()
        if EMPTY.match(text)
    ]


def test_a_docstring_of_a_function_that_returns_nothing_returns_nothing():
    silent = {'None', 'NoReturn'}
    assert not [
        place
        for place, node, text in documented()
        if isinstance(node, ast.FunctionDef)
        and text.startswith('Return ')
        and getattr(node.returns, 'id', getattr(node.returns, 'value', '')) in silent | {None}
    ]


def test_a_docstring_names_parameters_and_attributes_that_there_are():
    wrong = []
    for place, node, text in documented():
        if isinstance(node, ast.Module):
            continue
        named = re.findall(r'(?:^|\n|[.] )`([a-z_]\w*)`:', text)
        named += re.findall(r':param (\w+):', text)
        if not named:
            continue
        there = {
            getattr(each, field)
            for each in ast.walk(node)
            for field in ('arg', 'attr', 'id', 'name')
            if hasattr(each, field)
        }
        wrong += ['{} {}'.format(place, name) for name in named if name not in there]
    assert not wrong


def is_long(docstring):
    """Whether a docstring has a summary of several lines; that of a constructor may have none."""
    return not docstring.startswith(':') and '\n' in docstring.split('\n\n')[0]


def test_the_summary_of_a_docstring_is_one_line():
    documented = [(path, parse(path)) for path in PACKAGE] + definitions()
    wrong = [
        '{}:{}'.format(shown(path), getattr(node, 'lineno', 1))
        for path, node in documented
        if is_long(ast.get_docstring(node) or '')
    ]
    assert not wrong
