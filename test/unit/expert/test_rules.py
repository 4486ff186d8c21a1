"""Experts without a person: what rules answer, and how wrong rules are refused."""

import threading
import time

import pytest
from expert_fixtures import make_question
from waiting import Once

from smach_oracle.expert.rules import IGNORE, Rule, RuleExpert, Rules
from smach_oracle.expert.scripted_expert import load_rules, servers_of
from smach_oracle.oracle.asking.question import Answer, AnswerKind, StateChoice
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import FailureKind
from smach_oracle.oracle.settings.interfaces import InterfaceOffer

GOTO = {'kind': 'goto', 'state': 'DETECT'}
ASSIST = {'kind': 'interface', 'interface': 'assist'}


def test_the_most_specific_rule_answers():
    rules = Rules.parse({'default': {'kind': 'give_up'}, 'PICK': GOTO, 'KITCHEN/PICK': ASSIST})
    assert rules.next('/r', 't', 'KITCHEN', 'PICK').kind == 'interface'
    assert rules.next('/r', 't', 'HALL', 'PICK').kind == 'goto'
    assert rules.next('/r', 't', 'HALL', 'PLACE').kind == 'give_up'


def test_a_rule_for_a_machine_that_had_no_name_holds_now_that_it_has_its_nodes():
    rules = Rules.parse(
        {
            'SM_ROOT/PICK': GOTO,
            'SM_ROOT/ARM/PICK': ASSIST,
            'task/PICK': ASSIST,
            'default': {'kind': 'give_up'},
        }
    )
    assert rules.next('/task', 't', 'task', 'PICK').kind == 'interface'
    assert rules.next('/robot', 't', 'robot', 'PICK').kind == 'goto'
    assert rules.next('/robot', 't', 'robot/ARM', 'PICK').kind == 'interface'
    assert rules.next('/robot', 't', 'robot', 'PLACE').kind == 'give_up'


def test_without_a_rule_the_question_is_left_to_others():
    assert Rules.parse({'PICK': GOTO}).next('/r', 't', 'HALL', 'PLACE') == Rule(IGNORE)


def test_several_rules_of_a_state_are_used_one_after_another_in_every_trial():
    rules = Rules.parse({'PICK': [GOTO, ASSIST]})
    kinds = [rules.next('/r', trial, 'P', 'PICK').kind for trial in ('t1', 't1', 't1', 't2', 't2')]
    assert kinds == ['goto', 'interface', 'interface', 'goto', 'interface']


def test_robots_do_not_use_up_each_other_s_rules():
    rules = Rules.parse({'PICK': [GOTO, ASSIST]})
    assert [rules.next(robot, 't', 'P', 'PICK').kind for robot in ('/a', '/b')] == ['goto', 'goto']


@pytest.mark.parametrize(
    'settings, text',
    [
        ('PICK', "rules: 'PICK' is not allowed; allowed: a mapping"),
        ({'PICK': []}, 'PICK: .* is not allowed; allowed: a rule'),
        (
            {'PICK': 'goto DETECT'},
            "PICK: 'goto DETECT' is not allowed; allowed: a mapping with a kind",
        ),
        (
            {'PICK': {'kind': 'go'}},
            "PICK.kind: 'go' is not allowed; .*: give_up, goto, interface, supersede or ignore",
        ),
        ({'PICK': {'state': 'DETECT'}}, 'PICK.kind: None is not allowed'),
        (
            {'PICK': [GOTO, {'kind': 'goto'}]},
            r'PICK\[1\].state: None is not allowed; allowed: a name; goto needs one',
        ),
        ({'PICK': dict(GOTO, delay=3)}, 'PICK.delay: .* allowed: the keys kind, state'),
        (
            {'PICK': dict(GOTO, delay_s=-1)},
            'PICK.delay_s: -1 is not allowed; allowed: seconds from 0',
        ),
        ({'PICK': dict(GOTO, delay_s=True)}, 'PICK.delay_s: True'),
        ({'PICK': dict(GOTO, outputs=[1])}, r'PICK.outputs: \[1\]'),
        (
            {'PICK': dict(GOTO, confirm='yes')},
            "PICK.confirm: 'yes' is not allowed; allowed: true or",
        ),
        (
            {'PICK': dict(GOTO, why=3)},
            'PICK.why: 3 is not allowed. YAML reads 3 as a number: write "3"; allowed: a string',
        ),
        ({3: GOTO}, 'allowed: labels of states as keys'),
    ],
)
def test_wrong_rules_are_refused_with_what_is_allowed(settings, text):
    with pytest.raises(SettingsError, match=text):
        Rules.parse(settings)


def test_rules_come_from_a_file(tmp_path):
    path = tmp_path / 'rules.yaml'
    path.write_text('PICK: {kind: goto, state: DETECT}')
    assert load_rules(None, str(path)).next('/r', 't', 'P', 'PICK').state == 'DETECT'
    path.write_text('PICK: {kind: goto')
    french = tmp_path / 'french.yaml'
    french.write_bytes(b'PICK: {why: \xe9t\xe9}')
    for wrong in (str(path), str(french), str(tmp_path), str(tmp_path / 'none.yaml'), 7, ''):
        with pytest.raises(SettingsError, match='~rules'):
            load_rules(None, wrong)


@pytest.mark.parametrize(
    'value, names',
    [
        ('all', []),
        ('', []),
        ('/a/q /b/q', ['/a/q', '/b/q']),
        (['all'], []),
        (['/a/q', '/b/q'], ['/a/q', '/b/q']),
    ],
)
def test_servers_are_a_text_or_a_list(value, names):
    assert servers_of(value) == names


@pytest.mark.parametrize('value', [7, None, ['/a/q', 7], ['/a/q', ''], {'/a/q': 1}])
def test_servers_that_are_none_are_refused(value):
    with pytest.raises(SettingsError, match='~servers'):
        servers_of(value)


def ask(rules, cancelled=None, **changes):
    return RuleExpert(Rules.parse(rules)).ask(
        make_question(**changes), cancelled or threading.Event(), lambda *_: None
    )


def test_an_expert_by_rules_answers_in_the_same_process():
    answer = ask(
        {
            'PICK': {
                'kind': 'supersede',
                'outcome': 'succeeded',
                'outputs': {'grasped': 'mug'},
                'why': 'test',
            }
        }
    )
    assert answer == Answer(
        AnswerKind.SUPERSEDE,
        outcome='succeeded',
        outputs={'grasped': 'mug'},
        by='scripted',
        why='test',
    )


def test_an_answer_that_comes_after_the_deadline_is_none():
    begun_s = time.monotonic()
    assert ask({'PICK': dict(GOTO, delay_s=60)}, deadline_s=0.1) is None
    assert ask({'PICK': {'kind': 'ignore'}}, deadline_s=0.1) is None
    assert 0.2 <= time.monotonic() - begun_s < 10.0


POURED = (
    StateChoice('POUR', 0.9, 1, 1, (), (), repeats=('POUR',)),
    StateChoice('DETECT', 0.9, 1, 1, (), (), repeats=('POUR',)),
)


@pytest.mark.parametrize(
    'rule, answered',
    [
        ({'kind': 'goto', 'state': 'POUR'}, None),
        ({'kind': 'goto', 'state': 'POUR', 'confirm': False}, None),
        ({'kind': 'goto', 'state': 'POUR', 'confirm': True}, 'POUR'),
        (GOTO, 'DETECT'),
    ],
)
def test_a_rule_has_a_state_repeated_only_where_it_confirms_that(rule, answered):
    answer = ask({'PICK': rule}, choices=POURED, deadline_s=0.1)
    assert (answer and answer.state) == answered


def test_a_rule_that_does_not_confirm_says_so():
    rule = Rules.parse({'PICK': {'kind': 'goto', 'state': 'POUR'}}).next('/r', 't', 'P', 'PICK')
    assert rule.why_not(POURED) == (
        'POUR was done in this trial, and only a rule with confirm: true has it repeated'
    )
    assert rule.why_not(POURED[1:]) == '' == rule.why_not([POURED[0]._replace(repeats=())])


def test_rules_for_failures_are_not_for_a_state_that_still_runs():
    cancelled = threading.Event()
    cancelled.set()
    expert = RuleExpert(Rules.parse({'PICK': [GOTO, ASSIST], 'default': {'kind': 'give_up'}}))
    still_runs = make_question(failure_kind=FailureKind.STILL_RUNNING)
    assert expert.ask(still_runs, cancelled, None) is None
    answer = expert.ask(make_question(), threading.Event(), None)
    assert answer.kind is AnswerKind.GOTO, 'the first rule is for the first failure'


def test_a_question_taken_back_is_not_waited_for():
    class Cancelled(threading.Event):
        waited_for = False

        def wait(self, timeout=None):
            self.waited_for = True
            return super().wait(timeout)

    cancelled = Cancelled()
    asker = Once(lambda: cancelled.waited_for, cancelled.set)
    assert ask({'PICK': {'kind': 'ignore'}}, cancelled) is None
    asker.join()


def test_an_expert_by_rules_runs_the_interfaces_it_was_given():
    done = Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='assist')
    expert = RuleExpert(Rules({}), interfaces={'assist': lambda question: done})
    told = []
    run = [
        expert.run_interface(
            InterfaceOffer(name, '/x'),
            make_question(),
            threading.Event(),
            lambda *what: told.append(what),
        )
        for name in ('assist', 'other')
    ]
    assert run == [done, None]
    assert told == [
        ('interface_start', 'assist', ''),
        ('interface_end', 'assist', 'succeeded'),
        ('interface_start', 'other', ''),
        ('interface_end', 'other', ''),
    ]
