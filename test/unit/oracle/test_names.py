"""A script's own classes and objects may use any name for their own ends, those of an
OracleContainer among them.
"""

import importlib
import sys

import pytest
from machines import FakeExpert, Scripted, chain_of, supersede

import smach
import smach_oracle.oracle
from smach_oracle.oracle import OracleContainer, errors, oracle_of
from smach_oracle.oracle.asking import question
from smach_oracle.oracle.records.events import EventKind

NAMES = (
    'name',
    'path',
    'settings',
    'events',
    'trial_id',
    'is_top',
    'recovers',
    'rates',
    'transition_counts',
    'save_rates',
    'load_rates',
)


class SetsThem(smach.StateMachine):
    """A machine that keeps things of its own under these names."""

    def __init__(self, *args, **kwargs):
        smach.StateMachine.__init__(self, *args, **kwargs)
        for name in NAMES:
            setattr(self, name, ['own ' + name])

    def execute(self, *args, **kwargs):
        self.name = 'set while it runs'
        return smach.StateMachine.execute(self, *args, **kwargs)


class DefinesThem(smach.StateMachine):
    """A machine whose class uses some of them."""

    @property
    def name(self):
        return 'own name'

    def events(self):
        return 'own events'

    def rates(self, currency):
        return 'own rates in ' + currency


def recovered(machine, **settings):
    """Run it under an oracle; the kinds of its events."""
    wrapped = OracleContainer.wrap(machine, expert=FakeExpert(supersede('ok')), settings=settings)
    events = []
    oracle_of(wrapped).events.observers.append(events.append)
    assert wrapped.execute() == 'done'
    return [event.kind for event in events]


def test_a_list_of_names_says_where_it_is_empty():
    assert question.names([]) == '(none)'
    assert question.names(['b', 3, 'a']) == '3, a, b'


def test_what_a_script_keeps_on_its_machine_stays_its_own(tmp_path):
    machine = chain_of(Scripted('aborted'), machine_class=SetsThem)
    kinds = recovered(machine, rates_file=str(tmp_path / 'rates.json'))
    assert EventKind.JUMP in kinds and kinds[-1] is EventKind.TRIAL_END
    assert machine.name == 'set while it runs'
    assert [getattr(machine, name) for name in NAMES[1:]] == [['own ' + name] for name in NAMES[1:]]
    assert (tmp_path / 'rates.json').exists()


def test_what_a_scripts_class_defines_stays_its_own():
    machine = chain_of(Scripted('aborted'), machine_class=DefinesThem)
    assert EventKind.JUMP in recovered(machine)
    assert (machine.name, machine.events(), machine.rates('euros')) == (
        'own name',
        'own events',
        'own rates in euros',
    )


def test_adapters_read_the_containers_face_whatever_the_class_is_like():
    machine = chain_of(Scripted('aborted'), machine_class=SetsThem)
    recovered(machine)
    face = oracle_of(machine)
    assert (face.name, face.path, face.is_top, face.recovers) == ('SM_ROOT', 'SM_ROOT', True, True)
    assert face.trial_id and face.settings.policy == 'prose'
    assert [(row.state, row.failures) for row in face.rates()] == [('A', 1)]
    assert {row.to for row in face.transition_counts()} == {'A', 'ORACLE', 'done'}


@pytest.mark.parametrize('name', ['Answer', 'AnswerKind', 'Expert', 'Question'])
def test_what_an_expert_of_ones_own_needs_is_found_at_the_top_and_at_its_old_place(name):
    sys.modules.pop('smach_oracle.oracle.question', None)
    with pytest.warns(FutureWarning, match='moved to smach_oracle.oracle.asking.question'):
        old = importlib.import_module('smach_oracle.oracle.question')
    assert getattr(old, name) is getattr(question, name)
    assert getattr(smach_oracle.oracle, name) is getattr(question, name)
    assert name in smach_oracle.oracle.__all__


def test_the_old_name_of_an_error_warns_in_the_line_that_uses_it():
    with pytest.warns(FutureWarning, match='is now called SettingsError') as told:
        assert errors.ConfigError is errors.SettingsError
    assert told[0].filename == __file__
    with pytest.raises(AttributeError, match='NoSuchError'):
        errors.__getattr__('NoSuchError')
