"""From a real wrapped machine through the real recorder to the table: the counts are those of what
the machine did.
"""

import socket
import threading

import pytest

import smach
from smach_oracle import __version__
from smach_oracle.analysis.trial_counter import TrialEnding
from smach_oracle.analysis.trials import load_trials
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.ros.recorder import TrialRecorder


class Pick(smach.State):
    """Fails as often as told, then succeeds."""

    def __init__(self, failures=0):
        super().__init__(outcomes=['succeeded', 'aborted'])
        self.failures = failures

    def execute(self, userdata):
        self.failures -= 1
        return 'aborted' if self.failures >= 0 else 'succeeded'


class FakeExpert(Expert):
    """Does the failed state's work at once, or is not there."""

    def __init__(self, answers):
        self.answers = answers

    def ask(self, question, cancelled, progress):
        if not self.answers:
            return None
        return Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='fake')


class Meeting(Expert):
    """Who waits, and who is asked: each goes on once the other has come as far."""

    def __init__(self):
        self._both = threading.Barrier(2, timeout=20.0)

    def wait(self, seconds, what, scope):
        self._both.wait()

    def ask(self, question, cancelled, progress):
        self._both.wait()
        return Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='fake')


def run_trials(folder, failures, recover=True, expert=None):
    """One trial for each number of failures of PICK."""
    pick = Pick()
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add(
            'LOOK',
            smach.CBState(lambda _: 'succeeded', outcomes=['succeeded']),
            {'succeeded': 'PICK'},
        )
        smach.StateMachine.add('PICK', pick)
    OracleContainer.wrap(
        machine,
        name='TOP',
        recover=recover,
        expert=expert,
        settings={'max_recoveries': 3, 'memory': 100, 'policy': 'prose'},
    )
    recorder = TrialRecorder(str(folder), warn=pytest.fail)
    recorder.attach(machine)
    outcomes = []
    for count in failures:
        pick.failures = count
        outcomes.append(machine.execute())
    assert recorder.close(20.0)
    return outcomes, load_trials([str(folder)]).trials


def test_a_trial_names_where_and_with_what_it_began(tmp_path):
    _, (trial,) = run_trials(tmp_path, [0])
    origin = dict(trial.origin)
    assert (origin['host'], origin['version']) == (socket.gethostname(), __version__)
    assert {'python', 'engine', 'settings'} <= origin.keys()
    assert dict(trial.inputs) == {}


def test_recoveries_of_a_low_failure_state_are_counted(tmp_path):
    outcomes, trials = run_trials(tmp_path, [0, 1, 2])
    assert outcomes == ['succeeded'] * 3
    counts = [(trial.failures, trial.recoveries, trial.questions) for trial in trials]
    assert counts == [(0, 0, 0), (1, 1, 0), (2, 2, 0)]
    assert all(trial.ending is TrialEnding.SUCCESS and trial.lost_events == 0 for trial in trials)
    assert {trial.experiment for trial in trials} == {'TOP'} and all(
        trial.recovers for trial in trials
    )


def test_an_answered_question_is_counted_beside_the_recoveries_before_it(tmp_path):
    outcomes, (trial,) = run_trials(tmp_path, [10], expert=FakeExpert(answers=True))
    assert outcomes == ['succeeded']
    assert (trial.failures, trial.recoveries, trial.questions, trial.answered) == (4, 3, 1, 1)


def test_an_unanswered_question_ends_the_trial(tmp_path):
    outcomes, (trial,) = run_trials(tmp_path, [10], expert=FakeExpert(answers=False))
    assert outcomes == ['aborted']
    assert (trial.recoveries, trial.questions, trial.answered, trial.ending) == (
        3,
        1,
        0,
        TrialEnding.FAILURE,
    )


def test_without_the_oracle_a_failure_ends_the_trial(tmp_path):
    outcomes, trials = run_trials(tmp_path, [0, 1], recover=False)
    assert outcomes == ['succeeded', 'aborted']
    assert [trial.ending for trial in trials] == [TrialEnding.SUCCESS, TrialEnding.FAILURE]
    assert [trial.failures for trial in trials] == [0, 1]
    assert (
        not any(trial.recovers for trial in trials)
        and sum(trial.recoveries for trial in trials) == 0
    )


@pytest.mark.parametrize('asks, recoveries, questions', [(False, 2, 0), (True, 1, 1)])
def test_branches_that_are_recovered_at_the_same_time_all_count(
    asks, recoveries, questions, tmp_path
):
    both = smach.Concurrence(
        ['succeeded', 'aborted'],
        default_outcome='aborted',
        outcome_map={'succeeded': {'A': 'succeeded', 'B': 'succeeded'}},
    )
    with both:
        for label in ('A', 'B'):
            smach.Concurrence.add(label, Pick(failures=1))
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('BOTH', both)
    meeting = Meeting()
    states = {'BOTH/B': {'max_recoveries': 0}} if asks else {}
    OracleContainer.wrap(
        machine,
        name='TOP',
        expert=meeting,
        settings={'policy': {'name': 'ladder', 'wait_s': 1.0}, 'states': states},
    )
    oracle_of(machine).waiting = meeting
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail)
    recorder.attach(machine)
    assert machine.execute() == 'succeeded'
    assert recorder.close(20.0)
    (trial,) = load_trials([str(tmp_path)]).trials
    assert (trial.failures, trial.recoveries, trial.questions) == (2, recoveries, questions)
