"""A shallow copy of a machine has settings and records of its own. What `add` was given."""

import contextlib
import copy
import pickle

import pytest
from forked import Fork
from machines import Scripted, Watched, chain_of

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.machine.tree_node import node_of


def test_settings_given_with_add_to_a_copy_are_not_those_of_the_machine():
    machine = OracleContainer(['ok', 'aborted', 'preempted'])
    with machine:
        OracleContainer.add('A', Scripted(), prior=0.2)
    twin = copy.copy(machine)
    with twin:
        OracleContainer.add('B', Scripted(), prior=0.3)
    assert [node_of(each).settings_of('A').prior for each in (machine, twin)] == [0.2, 0.2]
    assert [node_of(each).settings_of('B').prior for each in (machine, twin)] == [0.1, 0.3]


def test_what_is_set_from_outside_wins_over_what_add_was_given_and_the_rest_stays():
    machine = OracleContainer(
        ['ok', 'aborted', 'preempted'], settings={'states': {'A': {'prior': 0.4}}}
    )
    with machine:
        OracleContainer.add('A', Scripted(), prior=0.2, time_limit_s=3.0)
    settings = node_of(machine).settings_of('A')
    assert (settings.prior, settings.time_limit_s) == (0.4, 3.0)


def test_a_state_that_was_added_as_guarded_is_not_repeated():
    machine = OracleContainer(['ok', 'aborted', 'preempted'], settings={'policy': 'restart'})
    with machine:
        OracleContainer.add('A', Scripted(), {'ok': 'B'}, on_retry='confirm')
        OracleContainer.add('B', Scripted('aborted'))
    assert machine.execute() == 'aborted'


def test_a_copy_learns_on_its_own_from_what_the_machine_had_learned(tmp_path):
    path = str(tmp_path / 'rates.json')
    other = OracleContainer.wrap(chain_of(Scripted('aborted')))
    assert other.execute() == 'done'
    other.save_rates(path)
    machine = OracleContainer.wrap(chain_of(Scripted('aborted', 'aborted')))
    machine.load_rates(path)
    first = copy.copy(machine)
    assert machine.execute() == 'done'
    assert [row.failures for each in (machine, first) for row in each.rates()] == [3, 1]
    second, counts = copy.copy(machine), machine.transition_counts()
    assert second.transition_counts() == counts
    machine.get_children()['A'].script = ['aborted']
    assert second.execute() == 'done'
    assert machine.transition_counts() == counts != second.transition_counts()
    assert [row.failures for each in (machine, second) for row in each.rates()] == [3, 4]


def test_a_copy_that_runs_in_the_same_trial_fails_on_its_own():
    def run_copy(state, ud):
        return 'ok' if copy.copy(inner).execute() == 'done' else 'aborted'

    inner = chain_of(Scripted(), Scripted('aborted', 'ok', 'aborted', 'ok', 'aborted'))
    top = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('N', inner, {'done': 'COPY'})
        smach.StateMachine.add('COPY', Scripted(run_copy), {'ok': 'MORE'})
        more = Scripted('again', outcomes=('ok', 'again'))
        smach.StateMachine.add('MORE', more, {'again': 'N', 'ok': 'done'})
    machine = Watched(top, settings={'policy': 'prose'})
    assert machine.run() == 'done'
    assert machine.decisions() == [('revisit', 'B')] * 3


class Plain(smach.State):
    """It can be pickled, and ends well."""

    def __init__(self):
        smach.State.__init__(self, outcomes=['ok'])

    def execute(self, ud):
        return 'ok'


def test_a_machine_that_was_pickled_in_another_process_is_this_ones():
    def pickled():
        try:
            return pickle.dumps(OracleContainer.wrap(chain_of(Plain())))
        except TypeError:  # this engine cannot pickle machines
            return None

    fork = Fork()
    if fork.inside:
        fork.end_with(pickled)
    fork.wait()
    made = fork.answer()
    if made is None:
        pytest.skip('this engine cannot pickle machines')
    machine = pickle.loads(made)
    assert not oracle_of(machine).is_parents
    assert machine.execute() == 'done' and machine.rates()[0].successes == 1


@pytest.mark.parametrize('settings', [{}, {'failing_outcomes': ['lost']}])
def test_a_copied_or_pickled_machine_has_its_failing_outcomes(settings):
    machine = OracleContainer.wrap(chain_of(Plain()), settings=settings)
    copies = [copy.deepcopy(machine)]
    with contextlib.suppress(TypeError):  # upstream's engine cannot pickle machines
        copies.append(pickle.loads(pickle.dumps(machine)))
    for each in copies:
        failing = node_of(each).in_force.failing
        assert ['line_lost' in failing, 'aborted' in failing] == [True, not settings]
        assert each.execute() == 'done'
