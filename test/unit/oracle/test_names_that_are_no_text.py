"""Outcomes and labels may be numbers, truth values or members of an Enum, as SMACH allows."""

import enum
import os

import pytest
from machines import FakeExpert, Scripted

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.oracle.errors import LabelError
from smach_oracle.oracle.settings.failure_rule import EndMeaning, FailureRule


class Seen(enum.Enum):
    GOOD = 1
    BAD = 2


class Code(int, enum.Enum):
    GOOD = 0
    BAD = 1


NAMES = [(Seen.GOOD, Seen.BAD), (Code.GOOD, Code.BAD), (0, 1), (1, 0), (True, False), (False, True)]


def tree(good, bad, *script, ends=None):
    """A, and a machine with B in it, which end as the script says."""
    end, failing = ends or (good, bad)
    steps, runs = list(script), []

    def work(state, userdata):
        runs.append(state)
        step = steps.pop(0) if steps else good
        if isinstance(step, Exception):
            raise step
        return step

    inner = smach.StateMachine(outcomes=[good, bad])
    machine = smach.StateMachine(outcomes=[end, failing])
    states = [Scripted(*[work] * 30, outcomes=(good, bad)) for _ in range(2)]
    with inner:
        smach.StateMachine.add('B', states[1])
    with machine:
        smach.StateMachine.add('A', states[0], {good: 'IN', bad: failing})
        smach.StateMachine.add('IN', inner, {good: end, bad: failing})
    return machine, runs


@pytest.mark.parametrize('good, bad', NAMES)
@pytest.mark.parametrize('is_bad', [(), (True,), (False, True)])
def test_a_machine_ends_as_without_an_oracle(good, bad, is_bad):
    script = [bad if each else good for each in is_bad]
    bare, bare_runs = tree(good, bad, *script)
    wrapped, runs = tree(good, bad, *script)
    outcome = OracleContainer.wrap(wrapped).execute()
    assert (outcome, type(outcome)) == (bare.execute(), type(good))
    assert len(runs) == len(bare_runs)


@pytest.mark.parametrize('good, bad', NAMES)
def test_what_raises_is_tried_again(good, bad):
    machine, runs = tree(good, bad, good, ValueError('no arm'))
    assert OracleContainer.wrap(machine).execute() is good
    assert len(runs) == 3


def test_a_failing_end_is_one_whatever_leads_there():
    machine, runs = tree(Seen.GOOD, Seen.BAD, Seen.BAD, ends=('succeeded', 'aborted'))
    assert OracleContainer.wrap(machine).execute() == 'succeeded'
    assert len(runs) == 3


@pytest.mark.parametrize('ends', [(1, 2), (1, 0), (True, False)])
def test_a_machine_given_up_ends_in_the_outcome_itself(ends):
    machine, _ = tree('succeeded', 'aborted', *['aborted'] * 30, ends=ends)
    assert OracleContainer.wrap(machine).execute() is ends[1]


@pytest.mark.parametrize('ends', [(1, 2), (1, 0), (True, False)])
def test_so_does_one_that_is_only_observed(ends):
    machine, _ = tree('succeeded', 'aborted', 'aborted', ends=ends)
    assert OracleContainer.wrap(machine, recover=False).execute() is ends[1]


@pytest.mark.parametrize('ends', [(1, 2), (1, 0), (True, False)])
def test_so_does_one_that_is_preempted(ends):
    def preempt(state, userdata):
        machine.request_preempt()
        return 'aborted'

    machine, runs = tree('succeeded', 'aborted', ends=ends)
    machine.get_children()['A'].script = [preempt]
    assert OracleContainer.wrap(machine).execute() is ends[1] and not runs


@pytest.mark.parametrize('good, bad', NAMES)
@pytest.mark.parametrize('kind', [AnswerKind.SUPERSEDE, AnswerKind.GIVE_UP])
def test_a_person_answers_by_the_text_of_an_outcome(good, bad, kind):
    machine, _ = tree(good, bad, ValueError('no arm'))
    expert = FakeExpert(Answer(kind, outcome=str(bad)))
    settings = {'policy': 'always_ask'}
    assert OracleContainer.wrap(machine, settings=settings, expert=expert).execute() is bad


def test_an_interface_supersedes_by_the_text_of_an_outcome():
    machine, _ = tree(True, False, ValueError('no arm'))
    expert = FakeExpert(
        Answer(AnswerKind.INTERFACE, interface='by_hand'),
        interface=lambda *given: Answer(AnswerKind.SUPERSEDE, outcome='False'),
    )
    settings = {
        'policy': 'always_ask',
        'expert': {'interfaces': {'by_hand': {'action': 'by_hand', 'states': ['A']}}},
    }
    assert OracleContainer.wrap(machine, settings=settings, expert=expert).execute() is False


def test_an_end_counts_as_the_text_that_is_recorded():
    assert FailureRule().meaning(False) is FailureRule().meaning('False') is EndMeaning.UNKNOWN
    assert FailureRule(('2',)).meaning(2) is EndMeaning.FAILURE


@pytest.mark.parametrize('good, bad', NAMES)
@pytest.mark.parametrize('given', ['failing_outcomes', 'failure_outcomes'])
def test_the_settings_name_an_outcome_by_its_text(good, bad, given):
    machine, runs = tree(good, bad, bad)
    assert OracleContainer.wrap(machine, settings={given: [str(bad)]}).execute() is good
    assert len(runs) == 3


def test_one_is_meant_so_by_its_text():
    machine, runs = tree('ok', 2, 2, ends=('ok', 'failed'))
    settings = {'states': {'A': {'intended_outcomes': ['2']}}}
    assert OracleContainer.wrap(machine, settings=settings).execute() == 'failed'
    assert len(runs) == 1


# -- labels


def chain(labels, *script):
    machine = smach.StateMachine(outcomes=['ok', 'aborted'])
    states = [Scripted(*script, outcomes=('ok', 'aborted')), Scripted(outcomes=('ok', 'aborted'))]
    with machine:
        for label, state, after in zip(labels, states, (labels[1], 'ok')):
            smach.StateMachine.add(label, state, {'ok': after})
    return machine, states


@pytest.mark.parametrize('labels', [(0, 1), (Seen.GOOD, Seen.BAD), ('A', 1)])
def test_a_machine_with_a_label_that_is_no_text_is_refused_and_stays_bare(labels):
    machine, _ = chain(labels)
    with pytest.raises(
        LabelError, match='TASK: the label .* of a state is not text; allowed: text'
    ):
        OracleContainer.wrap(machine, name='TASK')
    assert type(machine) is smach.StateMachine
    assert machine.execute() == 'ok'


@pytest.fixture
def told(monkeypatch):
    """What is warned of."""
    heard = []
    monkeypatch.setattr(smach, 'logwarn', heard.append)
    return heard


WHY = "the label 0 of a state is not text; allowed: text, such as '0'"


def test_a_machine_that_gets_such_a_label_later_does_not_begin():
    machine, _ = chain(('A', 'B'))
    wrapped = OracleContainer.wrap(machine, name='TASK')
    with machine:
        smach.StateMachine.add(3, Scripted(outcomes=('ok', 'aborted')))
    with pytest.raises(LabelError, match='TASK: the label 3 of a state is not text'):
        wrapped.execute()


def test_one_inside_of_others_is_tried_again_as_a_whole(told):
    inner, states = chain((0, 1), 'ok', 'aborted')
    states[1].script = ['aborted']
    machine = smach.StateMachine(outcomes=['ok', 'aborted'])
    with machine:
        smach.StateMachine.add('IN', inner)
    wrapped = OracleContainer.wrap(machine, name='TASK')
    assert told == ['TASK/IN: it has no oracle of its own, since ' + WHY]
    assert [wrapped.execute(), wrapped.execute()] == ['ok', 'ok']
    assert [each for each in told if 'since' in each] == told[:1]
    assert [each.runs for each in states] == [4, 3]
    assert [row.state for row in wrapped.rates()] == ['IN']


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')), reason='its Concurrence wants text as labels'
)
def test_a_concurrence_with_such_labels_has_no_oracle_within(told):
    branches = [Scripted(*script, outcomes=('ok', 'aborted')) for script in ([], ['aborted'])]
    beside = smach.Concurrence(['ok', 'aborted'], 'ok', outcome_map={'aborted': {1: 'aborted'}})
    with beside:
        for label, branch in enumerate(branches):
            smach.Concurrence.add(label, branch)
    machine = smach.StateMachine(outcomes=['ok', 'aborted'])
    with machine:
        smach.StateMachine.add('BESIDE', beside)
    wrapped = OracleContainer.wrap(machine, name='TASK')
    assert told == ['TASK/BESIDE: its states get no oracle, since ' + WHY]
    assert [wrapped.execute(), wrapped.execute()] == ['ok', 'ok']
    assert [each for each in told if 'since' in each] == told[:1]
    assert [each.runs for each in branches] == [3, 3]


class StateName(str, enum.Enum):
    LOOK = 'look'
    PICK = 'pick'


def test_a_label_that_is_a_member_of_an_enum_is_called_by_its_value(told):
    machine, states = chain(tuple(StateName))
    states[1].script = ['aborted'] * 2
    assert OracleContainer.wrap(machine, name='TASK').execute() == 'ok'
    assert told == ['TASK/pick failed: aborted'] * 2


def test_the_question_and_the_policy_call_it_so():
    machine, states = chain(tuple(StateName))
    states[1].script = ['aborted'] * 2
    expert = FakeExpert(Answer(AnswerKind.GOTO, 'look'))
    settings = {'policy': {'name': 'ladder', 'wait_s': 0}, 'max_recoveries': 1}
    assert OracleContainer.wrap(machine, settings=settings, expert=expert).execute() == 'ok'
    (question,) = expert.questions
    assert question.reason.startswith('pick ') and question.failed_state == 'pick'


def test_a_restart_begins_with_it():
    machine, states = chain(tuple(StateName))
    states[1].script = ['aborted']
    assert OracleContainer.wrap(machine, settings={'policy': 'restart'}).execute() == 'ok'
    assert [each.runs for each in states] == [2, 2]


@pytest.mark.parametrize('odd', [5, 'odd', Seen.GOOD, Code.BAD])
@pytest.mark.parametrize('recover', [True, False])
def test_a_branch_may_end_by_what_it_has_not_registered(odd, recover):
    beside = smach.Concurrence(['ok', 'odd'], 'ok', outcome_map={'odd': {'LEFT': odd}})
    with beside:
        smach.Concurrence.add('LEFT', Scripted(*[odd] * 9, outcomes=['ok', 'aborted']))
        smach.Concurrence.add('RIGHT', Scripted(outcomes=['ok', 'aborted']))
    machine = smach.StateMachine(outcomes=['ok', 'odd'])
    with machine:
        smach.StateMachine.add('BESIDE', beside)
    assert OracleContainer.wrap(machine, recover=recover).execute() == 'odd'
