"""benchmarks/mutants.py: the faults that it puts in, and what becomes of them."""

import ast
import csv
import itertools
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest
from house import ROOT

sys.path.insert(0, str(ROOT / 'test/harness'))
sys.path.append(str(ROOT / 'benchmarks'))

from mutants import EQUIVALENT, EXECUTIVE, change_of, equivalents, summarise
from mutating import trying
from mutating.mutations import mutants_of


def changes(source):
    return {(mutant.before, mutant.after) for mutant in mutants_of(source, 'module.py')}


@pytest.mark.parametrize(
    'source, after',
    [
        ('a < b', {'a <= b', 'a >= b'}),
        ('a is b', {'a is not b'}),
        ('a in b', {'a not in b'}),
        ('a == (b or c)', {'a != (b or c)', '(b and c)', '(b)', '(c)'}),
        ('not a', {'(a)'}),
        ('a + b', {'(a - b)'}),
        ('"a" + b', set()),
        ('"%s" % b', set()),
        ('(a + b) * c', {'((a + b) / c)', '(a - b)'}),
        ('a < b < c', set()),
        ('x = True', {'False'}),
        ('x = 3', {'(3 + 1)'}),
        ('x = "text"', set()),
        ('x.y = z', {'pass'}),
        ('x = z', set()),
        ('x += z', {'pass'}),
        ('f(a)', {'pass'}),
        ('a', set()),
        ('"""a docstring"""', set()),
        ('a if b else c', {'(a)', '(c)'}),
        ('if a: b', {'(not (a))'}),
        ('if not a: b', {'(a)'}),
        ('if a < b: c', {'a <= b', 'a >= b'}),
        ('while a:\n  break', {'(not (a))', 'continue'}),
        ('while a:\n  continue', {'(not (a))', 'pass'}),
        ('[a for a in b if a]', {'(not (a))'}),
        ('raise Fault', {'pass'}),
        ('raise NotImplementedError', set()),
        ('def f() -> 3: return a', {'None'}),
        ('def f(): return False', {'True'}),
        ('def f(a: 3 = 4): pass', {'(4 + 1)'}),
        ('x: 3 = 4', {'(4 + 1)'}),
        ('class A(Protocol):\n  x = 3', set()),
        ('class A(Base):\n  x = 3', {'(3 + 1)'}),
        ('f"{a + b}"', set()),
    ],
)
def test_each_kind_of_part_has_its_faults(source, after):
    assert {new for _, new in changes(source)} == after


def test_a_fault_is_put_where_it_belongs_and_nothing_else_changes():
    source = 'a = "\u00e9"; b = (c +\n     d)  # \u00e9\nf(b)\n'
    sums = [mutant for mutant in mutants_of(source, 'module.py') if mutant.after == '(c - d)']
    assert [each.applied(source) for each in sums] == [
        'a = "\u00e9"; b = ((c - d))  # \u00e9\nf(b)\n'
    ]


def test_a_mutant_has_a_name_a_place_and_the_lines_of_its_statement():
    source = 'class A:\n  def f(self):\n    return g(\n      1,\n      a < b)\n'
    found = [mutant for mutant in mutants_of(source, 'm.py') if mutant.before == 'a < b']
    assert [mutant.name for mutant in found] == ['m.py:5:6:0', 'm.py:5:6:1']
    assert {(mutant.place, mutant.statement) for mutant in found} == {('A.f', (3, 5))}
    (condition,) = [
        each
        for each in mutants_of('if (a and\n    b):\n  f()\n', 'm.py')
        if each.after == '(a or b)' or each.after == '((a) or (b))'
    ]
    assert condition.statement == (1, 2), 'without the block below it'


def test_every_mutant_of_the_executive_is_python():
    mutants = EXECUTIVE.mutants()
    assert len(mutants) > 5000 and len({mutant.name for mutant in mutants}) == len(mutants)
    wrong = []
    for mutant in random.Random(1).sample(mutants, 300):
        path = ROOT / EXECUTIVE.mutated / mutant.module
        try:
            ast.parse(mutant.applied(path.read_text('utf-8')))
        except SyntaxError:
            wrong.append(mutant.name)
    assert wrong == []


def test_what_is_listed_as_equivalent_is_a_mutant_and_has_a_reason():
    with EQUIVALENT.open(newline='', encoding='utf-8') as file:
        assert [row for row in csv.DictReader(file) if not row['reason'].strip()] == []
    assert equivalents() - {change_of(mutant) for mutant in EXECUTIVE.mutants()} == set()


def test_tests_of_the_executive_load_from_a_copy_of_the_tree_without_built_messages():
    sources = os.pathsep.join([str(ROOT / 'src'), os.environ.get('PYTHONPATH', '')])
    loaded = subprocess.run(
        [sys.executable, '-m', 'pytest', '--collect-only', '-q', EXECUTIVE.tests],
        cwd=str(ROOT),
        env=dict(os.environ, PYTHONPATH=sources),
        stdout=subprocess.PIPE,
        universal_newlines=True,
    )
    assert not loaded.returncode, loaded.stdout[-2000:]


@pytest.mark.parametrize(
    'killed, survived, status',
    [(95, 5, 0), (94, 6, 1), (94, 5, 1), (0, 0, 0), (18, 1, 1), (19, 1, 0)],
)
def test_the_exit_status_says_whether_enough_were_killed(killed, survived, status, capsys):
    mutant = mutants_of('a < b', 'branches/m.py')[0]
    trials = [
        trying.Trial(mutant, verdict, '', 1, 0.0)
        for verdict, count in (('killed', killed), ('survived', survived))
        for _ in range(count)
    ]
    assert summarise(trials) == status
    assert 'killed: {} of {}'.format(killed, killed + survived) in capsys.readouterr().out


MODULE = """
import os, subprocess, sys

ON_IMPORT = 11

def made():
    return 13

MADE = made()
ODD = [each for each in range(23) if each % 2]

def checked(least, most):
    def check(value):
        return value > least and value < most
    return check

check = checked(100, 200)

def at_least(a, b):
    return a >= b

def counts(to):
    found = []
    while len(found) < to:
        found.append(bytes(1 << 22))
    return len(found)

def nobody_calls():
    return 3

def in_a_child(a):
    return int(subprocess.check_output([sys.executable, '-c', 'import m; print(m.doubled(4))']))

def doubled(a):
    return a * 2

def in_a_fork():
    child = os.fork()
    if not child:
        os._exit(left())
    return os.WEXITSTATUS(os.waitpid(child, 0)[1])

def left():
    return 5

def shared():
    return 7

def times_nine(a):
    return a * 9

def waits(event):
    while not event.is_set():
        event.wait(0.01)

class Above:
    def __init__(self):
        self.made = True

class Below(Above):
    def __init__(self):
        super().__init__()
"""
OTHER = """
def other():
    return 17
"""
TEST = """
import m, other, pytest, tempfile, threading

def test_at_least():
    assert m.at_least(2, 1) and not m.at_least(1, 2)

def test_counts():
    assert m.counts(3) == 3

def test_in_a_child():
    assert m.in_a_child(4) == 8

def test_in_a_fork():
    assert m.in_a_fork() == 5

@pytest.fixture(scope='module')
def made_once():
    return m.shared()

def test_begins(made_once):
    pass

def test_shared(made_once):
    assert made_once == 7

def test_on_import():
    assert m.ON_IMPORT == 11

def test_made():
    assert m.MADE == 13 and m.made() == 13

def test_odd():
    assert len(m.ODD) == 11

def test_check():
    assert m.check(150) and not m.check(300)

BEGUN = []

def test_begun():
    BEGUN.append(1)

def test_goes_on():
    assert BEGUN and m.times_nine(1) < 81

def test_times_nine():
    assert m.times_nine(2) == 18

KEPT = []

def test_below():
    KEPT.append(tempfile.TemporaryDirectory())
    assert m.Below().made

def test_both():
    assert other.other() == 17 and m.doubled(1) == 2

def test_waits():
    event = threading.Event()
    event.set()
    m.waits(event)
"""

CODE, CHECKS = 'src', 'test'  # the folders of a small project


@pytest.fixture
def workshop(tmp_path, monkeypatch):
    """A small project, and the place where its mutants are tried."""
    pytest.importorskip('coverage')
    monkeypatch.setattr(trying, 'SPARE_S', 3.0)
    monkeypatch.setattr(trying, 'SLOWER', 1.0)
    temporary = tmp_path / 'temporary'  # its own: other tests use the machine's meanwhile
    temporary.mkdir()
    monkeypatch.setenv('TMPDIR', str(temporary))
    root = tmp_path / 'tree'
    texts = {CODE + '/m.py': MODULE, CODE + '/other.py': OTHER, CHECKS + '/test_m.py': TEST}
    for name, text in texts.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    project = trying.Project(root, CODE, CHECKS)
    return project, trying.Workshop(project, tmp_path, 1)


def processes_of(folder):
    """Those that have a folder in their environment."""
    found = []
    for path in Path('/proc').glob('[0-9]*/environ'):
        try:
            if str(folder).encode() in path.read_bytes():
                found.append(path)
        except OSError:
            pass  # gone meanwhile, or somebody else's
    return found


def reaches_of(shop):
    """What its tests reach."""
    return list(itertools.chain.from_iterable(shop.look()))


def test_mutants_are_killed_or_live_as_the_tests_are(workshop):
    project, shop = workshop
    wanted = {
        'a >= b': {'a > b': 'survived', 'a < b': 'killed'},
        '3': {'(3 + 1)': 'unreached'},
        'a * 2': {'(a / 2)': 'killed'},  # a child of the test reaches it
        '5': {'(5 + 1)': 'killed'},  # so does one that it forks
        '7': {'(7 + 1)': 'killed'},  # the second test sees what is made for the first one, too
        '11': {'(11 + 1)': 'killed'},  # it was taken as the module was imported
        '13': {'(13 + 1)': 'killed'},  # so was this, by a function
        'each % 2': {'(not (each % 2))': 'killed'},
        'value > least and value < most': {
            '((value > least))': 'killed',  # a closure that lives, and needs less
            '((value > least) or (value < most))': 'killed',
        },
        'super().__init__()': {'pass': 'killed'},  # the function is another closure without it
        'a * 9': {'(a / 9)': 'killed'},  # another test fails with and without it
        'len(found) < to': {'len(found) >= to': 'killed'},
        'found.append(bytes(1 << 22))': {'pass': 'hung'},
        'not event.is_set()': {'(event.is_set())': 'hung'},
    }
    mutants = [
        mutant for mutant in project.mutants() if mutant.after in wanted.get(mutant.before, ())
    ]
    before = {path: path.read_text() for path in project.root.rglob('*.*')}
    trials = list(shop.try_all(mutants, reaches_of(shop)))
    assert [(trial.mutant.before, trial.mutant.after, trial.verdict) for trial in trials] == [
        (each.before, each.after, wanted[each.before][each.after]) for each in mutants
    ]
    assert len(trials) == sum(map(len, wanted.values()))
    seen_by = {trial.mutant.before: trial.by for trial in trials if trial.verdict == 'killed'}
    assert seen_by['7'] == CHECKS + '/test_m.py::test_shared'
    assert {path: path.read_text() for path in project.root.rglob('*.*')} == before
    assert processes_of(project.root.parent) == []
    assert os.listdir(os.environ['TMPDIR']) == [], 'what a fork has made is left'


@pytest.mark.parametrize('first', ['(17 + 1)', '(a / 2)'])
def test_no_mutant_sees_one_of_another_module_that_was_tried_before(workshop, first):
    project, shop = workshop
    mutants = [each for each in project.mutants() if each.after in ('(17 + 1)', '(a / 2)')]
    mutants.sort(key=lambda each: each.after != first)
    reaches = [each for each in reaches_of(shop) if 'both' in each.test]
    assert [trial.verdict for trial in shop.try_all(mutants, reaches)] == ['killed'] * 2


def test_who_only_imports_the_plugin_is_not_watched():
    assert 'mutating.forking' in sys.modules and sys.getprofile() is None


def test_each_test_runs_once_those_of_the_files_that_a_mutant_concerns_first():
    of_subject = [trying.Reach('test_it.py::{}'.format(n), set(), 0.1) for n in range(40)]
    of_others = [trying.Reach('test_all.py::{}'.format(n), set(), 0.1) for n in range(200)]
    quick = [trying.Reach('test_quick.py::{}'.format(n), set(), 0.01) for n in range(trying.FEW)]
    slow = [trying.Reach('test_slow.py', set(), 100.0)]
    tests = of_others + slow + of_subject + quick
    of_files = {'test_it.py': 50, 'test_all.py': 3000, 'test_quick.py': 500, 'test_slow.py': 1}
    runs = list(trying._in_runs(tests, of_files))
    assert sorted(sum(runs, [])) == sorted(tests)
    assert runs[0] == sorted(quick) and {each.file for each in runs[1]} == {
        'test_it.py',
        'test_all.py',
    }
    assert sum(each.file == 'test_it.py' for each in runs[1]) == trying.FEW
    assert slow[0] in runs[2]


def test_a_mutant_that_collects_without_end_has_the_memory_of_one_test(workshop):
    project, shop = workshop
    (endless,) = [
        mutant
        for mutant in project.mutants()
        if mutant.before == 'len(found) < to' and mutant.after == 'len(found) <= to'
    ]
    endless = endless._replace(text='True')
    (trial,) = shop.try_all([endless], reaches_of(shop))
    assert trial.verdict == 'killed', 'by a MemoryError'


def test_tests_that_fail_without_a_mutant_are_named(workshop):
    project, shop = workshop
    for path in project.root.parent.glob('*/{}/test_m.py'.format(CHECKS)):
        path.write_text('def test_it(): assert False')
    with pytest.raises(trying.TestsNotRun, match=CHECKS + '/test_m.py fails without a mutant'):
        list(shop.look())


def test_a_test_that_fails_once_does_not_kill(workshop):
    project, shop = workshop
    reaches = reaches_of(shop)
    for path in project.root.parent.glob('0/{}/test_m.py'.format(CHECKS)):
        path.write_text(
            'import os, m\ndef test_at_least():\n  if not os.path.exists("been"):\n'
            '    open("been", "w")\n    assert False'
        )
    (alive,) = [mutant for mutant in project.mutants() if mutant.after == 'a > b']
    (trial,) = shop.try_all([alive], reaches)
    assert trial.verdict == 'survived'
