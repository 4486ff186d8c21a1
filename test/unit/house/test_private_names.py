"""One file of the executive knows SMACH's private names, and no class of ours shows its own."""

import ast

from house import ROOT, parse

EXECUTIVE = ROOT / 'src/smach_oracle/oracle'
OWNER = EXECUTIVE / 'smach_private.py'
# of named tuples, public by the words of the standard library
PUBLIC = {'_replace', '_asdict', '_fields', '_field_defaults', '_make'}
BY_NAME = {'getattr', 'setattr', 'hasattr', 'delattr', 'own_mark', 'attribute_of', 'has_attribute'}


def is_private(name):
    return name.startswith('_') and not name.startswith('__') and name not in PUBLIC


def is_own(node):
    """Whether an expression is the object of the method that has it, or what it extends."""
    if isinstance(node, ast.Call):
        return getattr(node.func, 'id', '') == 'super'
    return isinstance(node, ast.Name) and node.id in {'self', 'cls'}


def private_names(tree):
    """The private names that a module uses on another object, with their lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and is_private(node.attr) and not is_own(node.value):
            yield node.lineno, node.attr
        if isinstance(node, ast.Call) and getattr(node.func, 'id', '') in BY_NAME:
            name = node.args[1] if len(node.args) > 1 else None
            if isinstance(name, ast.Constant) and isinstance(name.value, str):
                if is_private(name.value) and not is_own(node.args[0]):
                    yield node.lineno, name.value


def test_one_file_knows_smachs_private_names():
    found = {
        '{}:{}'.format(path.relative_to(EXECUTIVE), line): name
        for path in sorted(EXECUTIVE.rglob('*.py'))
        if path != OWNER
        for line, name in private_names(parse(path))
    }
    assert found == {}


def test_the_rule_sees_each_way_to_use_one():
    source = """
machine._states
node.machine._is_running = True
machine.userdata._data.copy()
getattr(machine, '_transitions', None)
own_mark(machine, '_items')
base = super()
base._copy_input_keys()
self._own, cls._own, super()._own, event._replace(seq=1), machine.__dict__, machine.states
"""
    assert [name for _, name in sorted(private_names(ast.parse(source)))] == [
        '_states',
        '_is_running',
        '_data',
        '_transitions',
        '_items',
        '_copy_input_keys',
    ]
