"""The tests themselves: each asserts something, and waits for what it means."""

import ast
import functools
import io
import tokenize

import pytest
from house import imports, nodes, parse, python_files, shown

# what made the test data is kept as it was then
FILES = [path for path in python_files('test') if 'data' not in path.parts]
ASSERTING = ('raises', 'warns', 'fail')
SLEEPS = ('sleep', 'wallsleep', 'Timer')
# helpers that look again and again, each with a deadline: by file and function
POLLS = {
    ('processes.py', 'stop'),
    ('processes.py', '_has_ended'),
    ('processes.py', 'kill_marked'),
    ('waiting.py', 'wait_for'),
    ('waiting.py', 'wait_in_loop'),
    ('waiting.py', 'stays'),
    ('smach_states.py', 'execute'),
}
FEWEST_WORDS = 3  # of a comment that gives a reason


def functions(tree):
    """All functions of a module, methods and inner ones too."""
    return [
        node for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
    ]


@functools.lru_cache(maxsize=None)
def functions_of(path):
    """All functions of a file."""
    return functions(parse(path))


def calls(node):
    """The last names of all functions that are called in `node`."""
    for each in ast.walk(node):
        if isinstance(each, ast.Call):
            yield getattr(each.func, 'attr', getattr(each.func, 'id', ''))


def asserts(node, helpers, seen=frozenset()):
    """Whether a function asserts something by itself, or by a helper that it calls or hands on."""
    if any(isinstance(each, ast.Assert) for each in ast.walk(node)):
        return True
    if any(name in ASSERTING or name.startswith('assert') for name in calls(node)):
        return True
    named = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)} | set(calls(node))
    return any(
        asserts(helpers[name], helpers, seen | {name}) for name in named & set(helpers) - seen
    )


def helpers_of(path):
    """By name: functions that are no tests, of a module and of those next to it that it imports."""
    modules = {name.split('.')[0] for _, name in imports(path)} | {path.stem}
    beside = [path.with_name(name + '.py') for name in sorted(modules)]
    return {
        node.name: node
        for each in beside
        if each.is_file()
        for node in functions_of(each)
        if not node.name.startswith('test_')
    }


def without_assertion(path):
    """The tests of a file in which nothing is asserted."""
    tests = [node for node in functions_of(path) if node.name.startswith('test_')]
    helpers = helpers_of(path) if tests else {}
    return [node.name for node in tests if not asserts(node, helpers)]


def found_in_files(find):
    """What `find` finds, by file."""
    return {shown(path): found for path in FILES for found in [find(path)] if found}


def test_every_test_asserts_something():
    assert found_in_files(without_assertion) == {}


@pytest.mark.parametrize(
    'body, fine',
    [
        ('x = 1', False),
        ('run(x)', False),
        ('subprocess.check_output(x)', False),
        ('quiet()', False),
        ('assert x', True),
        ('self.assertTrue(x)', True),
        ('with pytest.raises(E): f()', True),
        ('good()', True),
        ('in_child(good)', True),
        ('self.outer()', True),
    ],
)
def test_an_assertion_is_found_in_a_test_and_in_its_helpers(body, fine):
    text = 'def quiet(): quiet()\ndef good(): assert 1\ndef outer(): good()'
    helpers = {node.name: node for node in functions(ast.parse(text))}
    tree = ast.parse('def test_it():\n    ' + body)
    assert asserts(tree.body[0], helpers) is fine


def made_empty(path):
    """Lines of calls of `__new__`, other than that of a class above the one at hand."""
    return [
        node.lineno
        for node in nodes(path)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == '__new__'
        and not isinstance(node.func.value, ast.Call)
    ]


def test_objects_are_made_by_their_constructors():
    assert found_in_files(made_empty) == {}, 'filled in by a test it is not what the package makes'


def is_sleep(node):
    """Whether a node is a call that lets a fixed time pass. rospy.Timer is not: it repeats."""
    if not isinstance(node, ast.Call):
        return False
    owner = getattr(getattr(node.func, 'value', None), 'id', '')
    name = next(calls(node))
    return name in SLEEPS and (owner, name) != ('rospy', 'Timer')


def sleeps(tree, function=''):
    """(line, innermost function) of every call that lets a fixed time pass."""
    for node in ast.iter_child_nodes(tree):
        inner = node.name if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) else function
        if is_sleep(node):
            yield node.lineno, inner
        yield from sleeps(node, inner)


def comments(text):
    """The comments of a source, by line."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return {token.start[0]: token.string for token in tokens if token.type == tokenize.COMMENT}


def unexplained(path):
    """Lines of sleeps outside the helpers that poll, without a comment that says why."""
    reasons = comments(path.read_text(encoding='utf-8'))
    return [
        line
        for line, function in sleeps(parse(path))
        if (path.name, function) not in POLLS and len(reasons.get(line, '').split()) <= FEWEST_WORDS
    ]


def test_a_fixed_sleep_says_why_nothing_can_be_awaited():
    assert found_in_files(unexplained) == {}, 'waiting.py has wait_for, stays, Once and more'


def test_every_helper_that_polls_is_there_and_does():
    found = {(path.name, function) for path in FILES for _, function in sleeps(parse(path))}
    assert POLLS <= found


def test_a_sleep_is_found_wherever_it_hides():
    text = (
        'time.sleep(1)\nsleep(1)\nasync def work():\n  await asyncio.sleep(1)\n'
        'f(lambda: rospy.sleep(2))  # so\nthreading.Timer(1, f)\n'
        'time.sleep(1)  # the robot takes its time\nrospy.Timer(1, f)\n'
    )
    assert [line for line, _ in sleeps(ast.parse(text))] == [1, 2, 4, 5, 6, 7]
    assert comments(text) == {5: '# so', 7: '# the robot takes its time'}
