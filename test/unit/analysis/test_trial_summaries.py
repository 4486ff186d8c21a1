"""What is told of a trial from its events, and which bags are used."""

import io
import os
import shutil
import subprocess

import pytest
import rosbag
from fake_trials import FakeMachine
from std_msgs.msg import String

from smach_oracle import bag_format
from smach_oracle.analysis.bag_events import BagError, EventReader, find_bags
from smach_oracle.analysis.counting.trial_summary import summarise
from smach_oracle.analysis.table import format_text, write_csv
from smach_oracle.analysis.trial_counter import TrialEnding
from smach_oracle.analysis.trials import load_trials
from smach_oracle.analysis.variants import count_variants
from smach_oracle.oracle.records.events import NO_OUTCOME, Event, EventKind, FailureKind
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording.bag_writer import BagWriter


def story(*steps, trial_id='t', path='TOP'):
    """Events from (kind, fields) pairs, a second apart."""
    return [
        Event(kind, trial_id, seq, 100.0 + seq, fields.pop('path', path), **fields)
        for seq, (kind, fields) in enumerate((kind, dict(fields)) for kind, fields in steps)
    ]


START = (EventKind.TRIAL_START, {'data': {'recovers': True}})
END = (EventKind.TRIAL_END, {'outcome': 'succeeded'})
FAILURE = (EventKind.FAILURE, {'state': 'PICK', 'outcome': 'aborted'})
REVISIT = (EventKind.DECISION, {'state': 'PICK', 'outcome': 'revisit', 'target': 'PICK'})
STEP_BACK = (EventKind.DECISION, {'state': 'PICK', 'outcome': 'step_back', 'target': 'DETECT'})
ASK = (EventKind.DECISION, {'state': 'PICK', 'outcome': 'ask'})
JUMP = (EventKind.JUMP, {'state': 'PICK', 'target': 'PICK'})


def opened(query_id):
    return EventKind.QUERY_OPENED, {'state': 'PICK', 'query_id': query_id}


def answered(query_id, outcome='supersede'):
    return EventKind.QUERY_ANSWERED, {'query_id': query_id, 'outcome': outcome}


def test_a_quiet_trial():
    trial = summarise(story(START, END))
    assert (trial.experiment, trial.recovers, trial.ending, trial.outcome) == (
        'TOP',
        True,
        TrialEnding.SUCCESS,
        'succeeded',
    )
    assert (
        trial.failures,
        trial.recoveries,
        trial.questions,
        trial.answered,
        trial.lost_events,
    ) == (0, 0, 0, 0, 0)
    assert (trial.start_time, trial.duration_s) == (100.0, 1.0)


ENTERED = (EventKind.STATE_START, {'state': 'PICK'})


@pytest.mark.parametrize(
    'text, steps, ending',
    [
        ('InvalidUserCodeError: no', (ENTERED,), TrialEnding.FAILURE),
        ('KeyboardInterrupt: ', (ENTERED,), TrialEnding.PREEMPTED),
        (NO_OUTCOME, (ENTERED,), TrialEnding.PREEMPTED),  # a shutdown between two states
        (NO_OUTCOME, (), TrialEnding.FAILURE),  # an inconsistent machine
    ],
)
def test_a_trial_without_an_outcome_has_failed_unless_it_was_stopped_from_outside(
    text, steps, ending
):
    assert summarise(story(START, *steps, (EventKind.TRIAL_END, {'text': text}))).ending is ending


@pytest.mark.parametrize(
    'steps, recoveries, questions, answers',
    [
        ((FAILURE, REVISIT, JUMP), 1, 0, 0),
        ((FAILURE, STEP_BACK, JUMP), 1, 0, 0),
        ((FAILURE, REVISIT, JUMP, FAILURE, STEP_BACK, JUMP), 2, 0, 0),
        ((FAILURE, REVISIT), 0, 0, 0),  # decided, but the machine was preempted before it jumped
        (
            (FAILURE, ASK, opened('q'), answered('q', 'goto'), JUMP),
            0,
            1,
            1,
        ),  # the expert's jump is not the oracle's
        (
            (FAILURE, ASK, opened('q'), (EventKind.QUERY_EXPIRED, {'query_id': 'q'}), JUMP),
            0,
            1,
            0,
        ),  # the fallback's jump
        ((FAILURE, REVISIT, opened('q'), answered('q'), JUMP), 0, 1, 1),
        (
            (
                FAILURE,
                ASK,
                opened('q'),
                answered('q'),
                opened('r'),
                (EventKind.QUERY_CANCELLED, {'query_id': 'r'}),
            ),
            0,
            2,
            1,
        ),
        (
            (FAILURE, ASK, opened('q'), answered('q', 'interface'), answered('q', 'supersede')),
            0,
            1,
            1,
        ),
    ],
)
def test_recoveries_and_questions(steps, recoveries, questions, answers):
    trial = summarise(story(START, *steps, END))
    assert (trial.recoveries, trial.questions, trial.answered) == (recoveries, questions, answers)


def test_decisions_of_containers_side_by_side_are_kept_apart():
    inner = dict(path='TOP/PICK')
    trial = summarise(
        story(
            START,
            REVISIT,
            (EventKind.DECISION, dict(ASK[1], **inner)),
            (opened('q')[0], dict(opened('q')[1], **inner)),
            JUMP,
            (EventKind.JUMP, inner),
            END,
        )
    )
    assert trial.recoveries == 1


@pytest.mark.parametrize(
    'end, ending',
    [
        ((EventKind.TRIAL_END, {'outcome': 'succeeded'}), TrialEnding.SUCCESS),
        ((EventKind.TRIAL_END, {'outcome': 'drink_served'}), TrialEnding.SUCCESS),
        ((EventKind.TRIAL_END, {'outcome': 'aborted'}), TrialEnding.FAILURE),
        ((EventKind.TRIAL_END, {'outcome': 'grasp_failed'}), TrialEnding.FAILURE),
        ((EventKind.TRIAL_END, {'outcome': 'preempted'}), TrialEnding.PREEMPTED),
        (
            (EventKind.TRIAL_END, {'outcome': '', 'text': 'InvalidUserCodeError: ...'}),
            TrialEnding.FAILURE,
        ),
        ((EventKind.STATE_START, {'state': 'PICK'}), TrialEnding.UNFINISHED),
    ],
)
def test_how_a_trial_ended(end, ending):
    assert summarise(story(START, end)).ending is ending


def test_failures_are_counted_by_state_and_container():
    trial = summarise(
        story(
            START, FAILURE, FAILURE, (EventKind.FAILURE, {'state': 'PICK', 'path': 'TOP/SUB'}), END
        )
    )
    assert trial.failures_by_state == (('TOP/PICK', 2), ('TOP/SUB/PICK', 1))


def test_a_wait_for_health_is_time_and_no_failure():
    begin, end = (EventKind.HEALTH_WAIT_START, {}), (EventKind.HEALTH_WAIT_END, {})
    trial = summarise(story(START, ENTERED, begin, ENTERED, end, ENTERED, begin, end, END))
    assert (trial.failures, trial.recoveries, trial.unwell_s) == (0, 0, 3.0)
    assert trial.ending is TrialEnding.SUCCESS


def test_gaps_in_the_numbering_are_lost_events():
    events = story(START, FAILURE, REVISIT, JUMP, END)
    del events[1:3]
    assert summarise(events).lost_events == 2
    assert summarise(story(START, END)[1:]).lost_events == 1


def test_the_variant_is_what_the_start_says_else_what_was_seen():
    assert (
        summarise(story((EventKind.TRIAL_START, {'data': {'recovers': False}}), END)).recovers
        is False
    )
    assert summarise(story(FAILURE, REVISIT, JUMP)).recovers is True
    assert summarise(story(FAILURE, END)).recovers is None
    assert (
        summarise(story((EventKind.TRIAL_START, {'data': ['no', 'mapping']}), END)).recovers is None
    )


def test_trials_come_in_the_order_of_their_beginning_whatever_their_files_are_called(record):
    folder = record('bags', 5)
    for number, path in enumerate(sorted(os.listdir(folder), reverse=True)):
        os.rename(os.path.join(folder, path), os.path.join(folder, '{}.bag'.format(number)))
    trials, skipped = load_trials([folder])
    assert [trial.trial_id for trial in trials] == ['with-{}'.format(number) for number in range(5)]
    assert skipped == []


def test_a_trial_in_several_bags_is_one_trial(tmp_path):
    for part in range(2):
        recorder = TrialRecorder(str(tmp_path / str(part)))
        machine = FakeMachine(
            lambda event, part=part, recorder=recorder: (
                recorder(event) if (event.seq >= 6) == bool(part) else None
            )
        )
        machine.run(seed=3)
        assert recorder.close(20.0)
    (trial,), skipped = load_trials([str(tmp_path)])
    assert (trial.ending, trial.lost_events, len(trial.bags), skipped) == (
        TrialEnding.SUCCESS,
        0,
        2,
        [],
    )


def test_a_copied_folder_does_not_count_twice(record, tmp_path):
    folder = record('bags', 10)
    shutil.copytree(folder, str(tmp_path / 'copy'))
    assert [trial._replace(bags=()) for trial in load_trials([str(tmp_path)]).trials] == [
        trial._replace(bags=()) for trial in load_trials([folder]).trials
    ]


def test_many_trials_in_one_bag_of_rosbag_record_are_told_apart(tmp_path):
    from smach_oracle.ros.event_messages import to_msg

    with rosbag.Bag(str(tmp_path / 'all.bag'), 'w') as bag:
        machine = FakeMachine(lambda event: bag.write('/robot/oracle/events', to_msg(event)))
        for seed in range(4):
            machine.run(seed)
    trials = load_trials([str(tmp_path / 'all.bag')]).trials
    assert [trial.trial_id for trial in trials] == ['with-0', 'with-1', 'with-2', 'with-3']


def test_unusable_bags_are_named_with_the_reason_and_the_others_counted(record, tmp_path):
    folder = record('bags', 3)
    whole = find_bags([folder])[0]
    shutil.copy(whole, folder + '/cut.bag')
    os.truncate(folder + '/cut.bag', os.path.getsize(whole) - 200)
    with rosbag.Bag(folder + '/foreign.bag', 'w') as bag:
        bag.write('/chatter', String('hello'))
    with open(folder + '/text.bag', 'w') as text:
        text.write('not a bag at all')
    open(folder + '/nothing.bag', 'w').close()
    BagWriter(folder + '/orphan.bag.active').abandon()
    BagWriter(folder + '/unindexed.bag').abandon()
    trials, skipped = load_trials([folder])
    assert len(trials) == 3
    reasons = {os.path.basename(item.path): item.reason for item in skipped}
    assert sorted(reasons) == [
        'cut.bag',
        'foreign.bag',
        'nothing.bag',
        'orphan.bag.active',
        'text.bag',
        'unindexed.bag',
    ]
    assert 'no events of the executive' in reasons['foreign.bag']
    assert 'rosbag reindex' in reasons['orphan.bag.active']
    assert 'reindex' in reasons['unindexed.bag']
    assert 'empty' in reasons['nothing.bag']
    assert all(reasons.values())


def test_a_bag_damaged_anywhere_is_skipped_not_fatal(record, tmp_path):
    whole = find_bags([record('bags', 1)])[0]
    with open(whole, 'rb') as source:
        data = source.read()
    reader, refused = EventReader(), 0
    for position in range(20, len(data), 97):
        damaged = tmp_path / 'damaged.bag'
        damaged.write_bytes(data[:position] + b'\xa5' * 11 + data[position + 11 :])
        try:
            reader.read(str(damaged))
        except BagError:
            refused += 1
    assert refused > 5


def take_index_away(path):
    """Leave what a killed recorder leaves: whole chunks, no index."""
    with open(path, 'r+b') as bag:
        bag.seek(len(bag_format.MAGIC))
        header = bag_format.read_header(bag, 4096)
        bag.truncate(bag_format.UINT64.unpack(header['index_pos'])[0])
        bag.seek(len(bag_format.MAGIC))
        bag.write(bag_format.pack_bag_header(0, 0, 0))


def test_a_killed_recorders_bag_is_counted_after_rosbag_reindex(record):
    folder = record('bags', 2)
    path = find_bags([folder])[0]
    take_index_away(path)
    assert [item.path for item in load_trials([folder]).skipped] == [path]
    subprocess.run(['rosbag', 'reindex', '-q', path], check=True, timeout=60)
    # also leaves rosbag's backup of the unindexed bag alone
    trials, skipped = load_trials([folder])
    assert ([trial.ending for trial in trials], skipped) == ([TrialEnding.SUCCESS] * 2, [])


def test_what_is_not_there_is_said_clearly(tmp_path):
    with pytest.raises(BagError, match='missing: no such folder'):
        load_trials([str(tmp_path / 'missing')])
    with pytest.raises(BagError, match='no bags'):
        load_trials([str(tmp_path)])
    BagWriter(str(tmp_path / 'empty.bag')).close()
    with pytest.raises(BagError, match='nothing was recorded in 1 bag'):
        load_trials([str(tmp_path)])


def resumed_story():
    """Of two bags; the program was killed after the event with number 2, of which 1 is stored."""
    first = story(START, ENTERED, ENTERED)
    resumed = EventKind.RESUMED, {'data': {'last_seq': 1}}
    interrupted = EventKind.FAILURE, {'state': 'PICK', 'failure_kind': FailureKind.INTERRUPTED}
    later = story(resumed, interrupted, REVISIT, JUMP, ENTERED, END)
    return first + [event._replace(seq=event.seq + 1001) for event in later]


def test_a_resumed_trial_is_one_and_has_lost_nothing():
    trial = summarise(resumed_story())
    assert (trial.resumed, trial.lost_events, trial.failures) == (1, 0, 0)
    assert trial.ending is TrialEnding.SUCCESS


@pytest.mark.parametrize(
    'stopped_s, down_s',
    [
        (500.0, 400.0),  # what was recorded last was not stored
        (300.0, 300.0),  # what was stored last was not recorded
        (-3.0, 0.0),  # the clock was put back
        (None, 400.0),
    ],
)
def test_the_time_in_which_its_program_was_down_is_told_apart(stopped_s, down_s):
    events = story(START, ENTERED)
    data = {'last_seq': 1} if stopped_s is None else {'last_seq': 1, 'stopped_s': stopped_s}
    later = story((EventKind.RESUMED, {'data': data}), ENTERED, END)
    events += [event._replace(seq=event.seq + 1002, wall_time=501.0 + event.seq) for event in later]
    trial = summarise(events)
    assert (trial.down_s, trial.duration_s) == (down_s, 403.0)
    assert summarise(events[2:]).down_s == 0.0  # what came before is in no bag


def test_down_time_is_in_the_table_and_in_the_csv():
    trial = summarise(resumed_story())._replace(down_s=7.5)
    text = io.StringIO()
    write_csv(text, [trial])
    header, row = text.getvalue().splitlines()
    added = ',expert_answered,person_needed,variant,node,folder,host,version,script,inputs'
    assert header.endswith('unwell_s,resumed,down_s,wrong_object,damage' + added)
    assert row.endswith(',1,7.5,,,False,,with oracle,,,,,,')
    told = format_text(count_variants([trial, trial]))
    assert '2 trials were resumed after their program was stopped; it was down for 15 s' in told


def test_what_a_killed_program_had_stored_and_not_recorded_is_lost():
    events = resumed_story()
    del events[1:3]  # numbers 1, which is stored, and 2, of which nobody knows
    assert summarise(events).lost_events == 1


def test_a_trial_that_was_stopped_and_goes_on_ends_as_it_does_later():
    stopped = story(START, ENTERED, (EventKind.TRIAL_END, {'data': {'ended_by': 'stopped'}}))
    assert summarise(stopped).ending is TrialEnding.PREEMPTED
    later = story((EventKind.RESUMED, {'data': {'last_seq': 2}}), END)
    trial = summarise(stopped + [event._replace(seq=event.seq + 1002) for event in later])
    assert (trial.ending, trial.resumed) == (TrialEnding.SUCCESS, 1)
