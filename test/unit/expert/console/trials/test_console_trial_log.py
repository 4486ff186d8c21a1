"""Trials as a console counts them: as the analysis of their bags does, bounded, and with what has
helped.
"""

import itertools
import json
import random

import pytest

import smach
from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.trial_counter import TrialCounter, TrialEnding
from smach_oracle.expert.console.feeds.told_trials import told_trials
from smach_oracle.expert.console.feeds.views import event_of, event_view
from smach_oracle.expert.console.trials import recovery_statistics, trial_log
from smach_oracle.expert.console.trials.counts_table import counts_table, has_oracle
from smach_oracle.expert.console.trials.recovery_statistics import RecoveryStatistics
from smach_oracle.expert.console.trials.trial_log import TrialLog
from smach_oracle.msg import NodeTrials
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.oracle.records.events import Event, EventKind
from smach_oracle.oracle.settings.failure_rule import FailureRule
from smach_oracle.ros.event_messages import to_msg
from smach_oracle.ros.trials.trials_publisher import LatestTrial


class Chancy(smach.State):
    """Fails with a chance."""

    def __init__(self, draw, share):
        smach.State.__init__(self, ['succeeded', 'aborted'])
        self._draw, self._share = draw, share

    def execute(self, ud):
        return 'aborted' if self._draw.random() < self._share else 'succeeded'


class SomeExpert(Expert):
    """Answers sometimes."""

    def __init__(self, draw):
        self._draw = draw

    def ask(self, question, cancelled, progress):
        kind = self._draw.choice(['goto', 'supersede', 'give_up', 'none'])
        return {
            'goto': Answer(AnswerKind.GOTO, state='A', by='ann'),
            'give_up': Answer(AnswerKind.GIVE_UP, by='ann'),
            'supersede': Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='ann'),
        }.get(kind)


def run_trials(count, share=0.4, seed=1, **options):
    """Events of real trials, one list each."""
    draw = random.Random(seed)
    inner = smach.StateMachine(['succeeded', 'aborted'])
    with inner:
        smach.StateMachine.add('C', Chancy(draw, share), {'succeeded': 'D'})
        smach.StateMachine.add('D', Chancy(draw, share))
    sm = smach.StateMachine(['succeeded', 'aborted'])
    with sm:
        smach.StateMachine.add('A', Chancy(draw, share), {'succeeded': 'B'})
        smach.StateMachine.add('B', inner)
    oracle = OracleContainer.wrap(sm, name='TASK', settings={'max_recoveries': 2}, **options)
    oracle.expert = SomeExpert(draw)
    trials = []
    oracle.events.observers.append(lambda event: trials[-1].append(event))
    for _ in range(count):
        trials.append([])
        oracle.execute()
    return trials


def count(events):
    """As the console does: each event as it comes."""
    counter = TrialCounter()
    for event in events:
        counter.add(event)
    return counter


@pytest.mark.parametrize('share', [0.0, 0.4, 1.0])
def test_a_trial_is_counted_as_the_analysis_of_its_bag_counts_it(share):
    for events in run_trials(25, share):
        counter, summary = count(events), summarise(events[::-1])
        for name in (
            'experiment',
            'outcome',
            'failures',
            'recoveries',
            'questions',
            'answered',
            'ending',
            'lost_events',
            'recovers',
            'failures_by_state',
            'start_time',
            'duration_s',
            'settings',
        ):
            assert getattr(counter, name) == getattr(summary, name), name


def test_what_the_log_shows_of_a_trial_is_what_the_analysis_of_its_bag_counts():
    log, trials = TrialLog(), run_trials(25)
    for each in itertools.chain(*trials):
        log.add('/robot', each)
    for row, summary in zip(log.overview()['trials'][::-1], map(summarise, trials)):
        assert {
            key: row[key]
            for key in (
                'id',
                'experiment',
                'start',
                'ending',
                'outcome',
                'oracle',
                'failures',
                'recoveries',
                'questions',
                'answered',
                'lost',
            )
        } == {
            'id': summary.trial_id,
            'experiment': summary.experiment,
            'start': summary.start_time,
            'ending': summary.ending.value,
            'outcome': summary.outcome,
            'oracle': summary.recovers,
            'failures': summary.failures,
            'recoveries': summary.recoveries,
            'questions': summary.questions,
            'answered': summary.answered,
            'lost': summary.lost_events,
        }
        assert row['end'] == summary.start_time + summary.duration_s


def test_a_trial_whose_bag_is_played_counts_once():
    log, trials = TrialLog(), run_trials(5)
    for each in itertools.chain(*trials):
        log.add('/robot', each)
    before = log.overview(), log.events(trials[0][0].trial_id, 0)
    for each in itertools.chain(*trials):
        log.add('/robot', each)
    assert (log.overview(), log.events(trials[0][0].trial_id, 0)) == before


def test_the_table_counts_trials_in_which_it_happened_and_how_often():
    trials = run_trials(40)
    (row,) = counts_table(map(count, trials))
    of_bags = [summarise(events) for events in trials]
    assert row['trials'] == 40
    for name in ('failures', 'recoveries', 'questions', 'answered'):
        numbers = [getattr(summary, name) for summary in of_bags]
        assert row['counts'][name] == {'trials': sum(map(bool, numbers)), 'events': sum(numbers)}, (
            name
        )
    assert row['counts']['answered']['trials'] > 0
    assert (
        row['endings']['failure']
        == sum(summary.ending.value == 'failure' for summary in of_bags)
        > 0
    )


def test_a_trial_whose_end_says_nothing_is_counted_apart_where_there_is_one():
    def parked(number, rule):
        return [
            event(EventKind.TRIAL_START, trial=str(number), data={'failure_rule': rule}),
            event(EventKind.TRIAL_END, trial=str(number), outcome='parked'),
        ]

    by_name, listed = parked(1, {'by_name': 1}), parked(2, {'failing_outcomes': ['aborted']})
    log = TrialLog()
    for each in by_name + listed:
        log.add('/robot', each)
    rows = {row['id']: row for row in log.overview()['trials']}
    assert (rows['1']['ending'], rows['2']['ending']) == ('other', 'success')
    (row,) = counts_table(map(count, (by_name, listed)))
    assert row['endings'] == {'success': 1, 'failure': 0, 'other': 1, 'preempted': 0}
    (row,) = counts_table([count(listed)])
    assert 'other' not in row['endings']


def test_the_table_lists_the_time_in_which_trials_waited_until_the_robot_was_well():
    trials = run_trials(3)
    for waited_s, events in zip((2.5, 4.0), trials):
        at_s = events[-1].wall_time
        events[-1:-1] = [
            events[-1]._replace(kind=EventKind.HEALTH_WAIT_START),
            events[-1]._replace(kind=EventKind.HEALTH_WAIT_END, wall_time=at_s + waited_s),
        ]
    (row,) = counts_table(map(count, trials))
    assert row['unwell_s'] == 6.5


def test_a_trial_that_runs_is_not_in_the_table_and_one_heard_of_late_says_so():
    events = run_trials(1)[0]
    running = count(events[:-1])
    assert running.ending is TrialEnding.UNFINISHED and counts_table([running]) == []
    assert count(events[3:]).lost_events == 3


def test_a_trial_whose_start_was_not_heard_counts_as_one_with_an_oracle():
    late = count([event(EventKind.STATE_START), event(EventKind.TRIAL_END, outcome='succeeded')])
    assert late.recovers is None and has_oracle(late)
    (row,) = counts_table([late])
    assert row['oracle'] is True and row['trials'] == 1


NUMBERS = itertools.count()


def event(kind, state='PICK', trial='t', path='TASK', **fields):
    return Event(kind, trial, next(NUMBERS), 0.0, path, state, **fields)


def scored(*events):
    scores = RecoveryStatistics()
    for each in events:
        scores.add('/robot', each, each.outcome == 'aborted')
    return scores.recovery_counts(('/robot', 'TASK', 'PICK'), 'DETECT')


FAILED, JUMPED = event(EventKind.FAILURE), event(EventKind.JUMP, target='DETECT')


@pytest.mark.parametrize(
    'events, recovery_counts',
    [
        ([FAILED, JUMPED], (0, 0)),
        (
            [FAILED, JUMPED, event(EventKind.TRANSITION, 'DETECT'), event(EventKind.TRANSITION)],
            (1, 1),
        ),
        ([FAILED, JUMPED, FAILED], (0, 1)),
        ([FAILED, JUMPED, FAILED, JUMPED, event(EventKind.TRANSITION)], (1, 2)),
        ([FAILED, JUMPED, event(EventKind.CONTAINER_END, '', outcome='succeeded')], (1, 1)),
        ([FAILED, JUMPED, event(EventKind.CONTAINER_END, '', outcome='aborted')], (0, 1)),
        (
            [
                FAILED,
                JUMPED,
                event(EventKind.TRANSITION, path='OTHER'),
                event(EventKind.TRANSITION, trial='u'),
            ],
            (0, 0),
        ),
        (
            [
                FAILED,
                event(EventKind.SUPERSEDE),
                JUMPED,
                event(EventKind.CONTAINER_END, '', outcome='succeeded'),
            ],
            (0, 0),
        ),
        ([event(EventKind.TRANSITION)], (0, 0)),
        # the author's own way from a failure while the robot was not well
        ([FAILED, JUMPED, event(EventKind.TRANSITION, data={'not_counted': True})], (0, 0)),
        (
            [
                FAILED,
                JUMPED,
                event(EventKind.HEALTH_WAIT_START),
                event(EventKind.HEALTH_WAIT_END),
                event(EventKind.TRANSITION),
            ],
            (1, 1),
        ),
        # asked while it still ran: wait on, and taken out
        (
            [
                FAILED,
                JUMPED,
                event(EventKind.QUERY_ANSWERED, outcome='goto', target='PICK'),
                event(EventKind.TRANSITION),
            ],
            (1, 1),
        ),
        (
            [
                FAILED,
                JUMPED,
                event(EventKind.QUERY_ANSWERED, outcome='goto', target='PLACE'),
                event(EventKind.TRANSITION),
            ],
            (0, 1),
        ),
    ],
)
def test_going_somewhere_has_helped_if_the_state_then_succeeds(events, recovery_counts):
    assert scored(*events) == recovery_counts


def test_the_log_is_bounded_and_forgets_details_first(monkeypatch):
    monkeypatch.setattr(trial_log, 'MOST_TRIALS', 5)
    monkeypatch.setattr(trial_log, 'MOST_DETAILED', 2)
    monkeypatch.setattr(trial_log, 'MOST_EVENTS', 3)
    log = TrialLog()
    for number in range(9):
        for seq in range(6):
            log.add('/robot', event(EventKind.STATE_START, trial=str(number))._replace(seq=seq))
    assert [trial['id'] for trial in log.overview()['trials']] == ['8', '7', '6', '5', '4']
    assert [len(log.events(str(number), 0)) for number in range(3, 9)] == [0, 0, 0, 0, 3, 3]
    assert len(log.events('8', 2)) == 1 and log.events('unknown', 0) == []


def test_a_trial_that_runs_keeps_its_events_longer_than_those_that_are_over(monkeypatch):
    monkeypatch.setattr(trial_log, 'MOST_DETAILED', 2)
    log = TrialLog()
    log.add('/slow', event(EventKind.STATE_START, trial='waits'))
    for number in range(4):
        for kind in (EventKind.STATE_START, EventKind.TRIAL_END):
            log.add('/fast', event(kind, trial=str(number), outcome='succeeded'))
    assert [each['detailed'] for each in log.overview()['trials']] == [
        True,
        False,
        False,
        False,
        True,
    ]
    assert len(log.events('waits', 0)) == 1


def test_a_trial_whose_events_were_forgotten_is_not_told_from_the_middle(monkeypatch):
    monkeypatch.setattr(trial_log, 'MOST_DETAILED', 1)
    log = TrialLog()
    for trial in ('long', 'short', 'long'):
        log.add('/robot', event(EventKind.STATE_START, trial=trial))
    assert log.events('long', 0) == []
    assert [(each['id'], each['detailed']) for each in log.overview()['trials']] == [
        ('short', True),
        ('long', False),
    ]


def test_events_are_kept_in_little_memory_and_read_from_any_position():
    log = TrialLog()
    lines = []
    for seq in range(1000):
        told = event(EventKind.TRANSITION, trial='long', outcome='succeeded')._replace(seq=seq)
        log.add('/robot', told)
        lines.append(json.dumps(event_view(told)))
        if seq % 37 == 0:
            assert log.events('long', 0) == lines
    for start, most in ((0, 5), (60, 10), (64, 64), (130, 500), (959, 3), (958, 100), (1000, 5)):
        assert log.events('long', start, most) == lines[start : start + most]
    assert log.bytes_kept < sum(map(len, lines)) / 5


def test_the_events_of_all_trials_have_a_limit_in_bytes(monkeypatch):
    monkeypatch.setattr(trial_log, 'MOST_BYTES', 100000)
    log, draw = TrialLog(), random.Random(1)
    for number in range(6):
        for seq in range(100):
            text = '{:0200x}'.format(draw.getrandbits(800))
            log.add(
                '/robot',
                event(EventKind.TRANSITION, trial=str(number))._replace(seq=seq, text=text),
            )
            assert log.bytes_kept <= 100000
    kept = [len(log.events(str(number), 0)) for number in range(6)]
    assert kept[0] == 0 and kept[-1] == 100 and log.overview()['heard'] == 6


def test_scores_of_robots_that_come_and_go_are_bounded(monkeypatch):
    monkeypatch.setattr(recovery_statistics, '_MOST_PAIRS', 3)
    scores = RecoveryStatistics()
    for number in range(6):
        for kind in (EventKind.FAILURE, EventKind.JUMP, EventKind.TRANSITION):
            scores.add(
                '/robot_{}'.format(number), Event(kind, 't', 0, 0.0, 'TASK', 'A', target='B'), False
            )
    tried = [
        scores.recovery_counts(('/robot_{}'.format(number), 'TASK', 'A'), 'B').tried
        for number in range(6)
    ]
    assert tried == [0, 0, 0, 1, 1, 1]


def test_a_robot_that_dies_leaves_its_trial_marked():
    log = TrialLog()
    log.add('/robot', event(EventKind.TRIAL_START))
    log.end_missing('/robot')
    assert log.overview()['trials'][0]['outcome'] == 'the robot is gone'


def told_by_robot(events, nth=1):
    """Return what the robot's own node says about a trial that has come so far."""
    latest = LatestTrial('TASK', lambda path: None)
    for number in range(nth - 1):
        latest(event(EventKind.TRIAL_START, trial='before {}'.format(number)))
    for each in events:
        latest(each)
    return told_trials(NodeTrials(trials=[latest.message()]))


COUNTED = ('id', 'experiment', 'start', 'ending', 'outcome', 'failures', 'recoveries', 'questions')


@pytest.mark.parametrize('heard_from', [0, 5, None])
def test_a_trial_that_began_before_the_console_has_the_counts_of_its_robot(heard_from):
    for events in run_trials(10):
        log, whole = TrialLog(), TrialLog()
        sofar = events[:-1]
        log.take_told('/robot', told_by_robot(sofar, nth=3))
        for each in sofar:
            whole.add('/robot', each)
        for each in sofar[heard_from:] if heard_from is not None else ():
            log.add('/robot', each)
        (row,), (true,) = log.overview()['trials'], whole.overview()['trials']
        assert {key: row[key] for key in COUNTED} == {key: true[key] for key in COUNTED}
        unheard = len(sofar) if heard_from is None else min(heard_from, len(sofar))
        assert (row['nth'], row['lost']) == (3, unheard)


def test_a_trial_that_was_heard_in_part_is_counted_whole_when_it_ends():
    events = next(each for each in run_trials(10) if len(each) > 20)
    log = TrialLog()
    log.take_told('/robot', told_by_robot(events[:9]))
    for each in events[9:]:
        log.add('/robot', each)
    log.take_told('/robot', told_by_robot(events))
    (row,) = log.overview()['table']
    assert row['counts'] == counts_table([count(events)])[0]['counts']


def test_events_that_are_newer_than_what_the_robot_has_told_count():
    events = next(each for each in run_trials(10) if count(each).failures)
    log = TrialLog()
    log.take_told('/robot', told_by_robot(events[:1]))
    for each in events:
        log.add('/robot', each)
    assert log.overview()['trials'][0]['failures'] == count(events).failures


def test_a_trial_that_ended_before_the_console_came_is_not_listed():
    log = TrialLog()
    log.take_told('/robot', told_by_robot(run_trials(1)[0]))
    assert log.overview() == {'table': [], 'trials': [], 'heard': 0}


def test_a_later_trial_of_the_same_machine_ends_one_whose_end_was_not_heard():
    log = TrialLog()
    begun = [
        event(EventKind.TRIAL_START, trial=trial, path=path)._replace(wall_time=wall_time)
        for trial, path, wall_time in (
            ('old', 'TASK', 1.0),
            ('other', 'B', 1.0),
            ('new', 'TASK', 2.0),
        )
    ]
    for each in begun[:2]:
        log.add('/robot', each)
    log.take_told('/robot', told_by_robot(begun[2:]))
    rows = {row['id']: row['outcome'] for row in log.overview()['trials']}
    assert rows == {'old': trial_log.UNHEARD_END, 'other': '', 'new': ''}


def test_a_trial_that_is_kept_does_not_run():
    log = TrialLog()
    begun = event(EventKind.TRIAL_START)
    log.add('/robot', begun)
    kept = event(EventKind.TRIAL_END, data={'ended_by': 'kept'})
    log.take_told('/robot', told_by_robot([begun, kept]))
    assert log.overview()['trials'][0]['outcome'] == trial_log.KEPT


def test_trials_are_listed_by_when_they_began_not_by_when_they_were_found():
    log = TrialLog()
    for trial, wall_time in (('2', 2.0), ('1', 1.0), ('3', 3.0)):
        begun = event(EventKind.TRIAL_START, trial=trial)._replace(wall_time=wall_time)
        log.take_told('/' + trial, told_by_robot([begun]))
    assert [row['id'] for row in log.overview()['trials']] == ['3', '2', '1']


LISTED = FailureRule(('parked',))


@pytest.mark.parametrize('take', ['hear', 'be_told'])
def test_the_rule_of_a_trial_is_the_one_that_its_robot_names(take):
    log = TrialLog()
    begun = event(EventKind.TRIAL_START, data={'failure_rule': LISTED.as_data()})
    if take == 'hear':
        log.add('/robot', event_of(to_msg(begun._replace(seq=0))))
    else:
        log.take_told('/robot', told_by_robot([begun]))
    assert log.rule('t') == LISTED
    assert log.rule('nobody has heard of it') == FailureRule()


def test_a_trial_whose_start_was_not_heard_has_the_rule_of_names():
    log = TrialLog()
    log.add('/robot', event(EventKind.FAILURE)._replace(seq=7))
    assert log.rule('t') == FailureRule()
