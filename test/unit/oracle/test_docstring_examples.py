"""The examples in the docstrings of what a user meets first are there, and true."""

import ast
import doctest
import inspect
from pathlib import Path

import pytest

import smach
import smach_oracle.analysis
import smach_oracle.oracle
import smach_oracle.testing
from smach_oracle.oracle.asking import question
from smach_oracle.oracle.decision import failure_rate, policy
from smach_oracle.oracle.execution import wrapping
from smach_oracle.oracle.machine import oracle
from smach_oracle.oracle.records import events, way_results
from smach_oracle.oracle.settings import failing_outcomes, failure_rule

ROOT = Path(__file__).parents[3]
FINDER = doctest.DocTestFinder()
SHOWN = [
    smach_oracle.oracle.OracleContainer,
    smach_oracle.oracle.OracleContainer.wrap,
    smach_oracle.oracle.OracleContainer.add,
    smach_oracle.oracle.Settings,
    smach_oracle.oracle.OperatorHand,
    smach_oracle.oracle.register_codec,
    wrapping.unwrap,
    oracle.Oracle,
    failing_outcomes.FailingNames,
    question.Expert,
    events,
    policy.Policy,
    failure_rate.FailureRate,
    failure_rate.ExponentialFailureRate,
    failure_rule.FailureRule,
    way_results.failure_text_key,
    smach_oracle.analysis.TrialSet,
    smach_oracle.testing.Bench,
    smach_oracle.testing.StoppedClock,
    smach_oracle.testing.expert,
    smach_oracle.testing.faults,
    smach_oracle.testing.soak,
]


@pytest.fixture(autouse=True)
def silent_log():
    """An example shows what its own lines return, and not the log."""
    log = smach.loginfo, smach.logwarn, smach.logerr, smach.logdebug
    smach.set_loggers(*[lambda *_: None] * 4)
    yield
    smach.set_loggers(log[0], log[1], log[3], log[2])


@pytest.mark.parametrize('shown', SHOWN, ids=lambda each: each.__name__)
def test_an_example_shows_what_it_says(shown, monkeypatch):
    monkeypatch.chdir(ROOT)  # one reads bags that are held here
    module = inspect.getmodule(inspect.unwrap(shown))
    name = getattr(shown, '__qualname__', shown.__name__)
    (example,) = FINDER.find(shown, name, module=module)[:1]
    assert example.examples, '{} has no example'.format(name)
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE, verbose=False)
    assert runner.run(example, out=told.append).failed == 0, ''.join(told)


def test_no_example_in_the_package_is_left_out():
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    written = [
        (path.name, getattr(node, 'name', ''))
        for path in Path(smach_oracle.__file__).parent.rglob('*.py')
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(node, kinds) and '>>> ' in (ast.get_docstring(node) or '')
    ]
    assert len(written) == len(SHOWN), written
