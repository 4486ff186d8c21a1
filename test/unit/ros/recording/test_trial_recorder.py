"""What a user finds in the folder of bags when nothing goes wrong with the disk."""

import multiprocessing
import os
import re
import signal
import threading
import time
from pathlib import Path

import pytest
from fake_trials import FakeMachine, play
from recorded import STRING, active, events, finished, messages, numbers, string_data
from waiting import wait_for

from smach_msgs.msg import SmachContainerStructure
from smach_oracle.msg import OracleRates
from smach_oracle.oracle.records.events import EventKind, EventSource
from smach_oracle.ros.recorder import TrialRecorder
from smach_oracle.ros.recording import trial_bag as recorder_bag
from smach_oracle.ros.recording.bag_writer import MessageType
from smach_oracle.ros.recording.event_packing import serialise
from smach_oracle.ros.recording.recorder_queue import MessageItem, Moment, RecorderQueue


@pytest.fixture
def source():
    return EventSource(pytest.fail)


@pytest.fixture
def recorder(tmp_path, source):
    made = TrialRecorder(str(tmp_path), warn=pytest.fail)
    made.attach(source)
    yield made
    made.close(10.0)


def trial(source, trial_id, steps=3, end=True):
    source.begin_trial(trial_id)
    source.emit(EventKind.TRIAL_START, 'TOP', data={'recovers': True})
    for _ in range(steps):
        source.emit(EventKind.STATE_START, 'TOP', state='A')
    if end:
        source.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded')


def test_each_trial_has_a_bag_named_by_its_time_and_its_id(recorder, source, tmp_path):
    for trial_id in ('first', 'second/../x y'):
        trial(source, trial_id)
    assert recorder.close(10.0)
    names = [os.path.basename(path) for path in finished(tmp_path)]
    assert re.match(r'\d{8}T\d{6}\.\d{3}Z_first\.bag$', names[0])
    assert re.match(r'\d{8}T\d{6}\.\d{3}Z_second_.._x_y\.bag$', names[1])
    assert active(tmp_path) == []


def test_a_machine_that_is_detached_is_recorded_no_more(recorder, source, tmp_path):
    for trial_id in ('told its end', 'did not'):
        trial(source, trial_id, end=trial_id != 'did not')
    recorder.detach(source)
    recorder.detach(source)
    assert wait_for(lambda: len(finished(tmp_path)) == 2), 'no bag stays open'
    trial(source, 'later')
    assert source.observers == []
    recorder.attach(source)
    trial(source, 'again')
    assert recorder.close(10.0)
    assert [path[-9:-4] for path in finished(tmp_path)[2:]] == ['again'] and not active(tmp_path)


def test_a_bag_holds_every_event_as_it_was_told(recorder, source, tmp_path):
    source.begin_trial('t')
    source.emit(EventKind.TRIAL_START, 'TOP', data={'initial': ['A'], 'recovers': False})
    source.emit(
        EventKind.FAILURE,
        'TOP/SUB',
        state='PICK',
        outcome='aborted',
        failure_kind=2,
        failure_class=1,
        rate=0.25,
        continuous=True,
        text='caf\xe9 \u2713',
    )
    source.emit(EventKind.TRIAL_END, 'TOP', outcome='aborted')
    recorder.close(10.0)
    start, failure, end = events(finished(tmp_path)[0])
    assert (start.kind, start.data) == (
        EventKind.TRIAL_START,
        '{"initial": ["A"], "recovers": false}',
    )
    assert (failure.path, failure.state, failure.rate, failure.continuous) == (
        'TOP/SUB',
        'PICK',
        0.25,
        True,
    )
    assert failure.text == 'caf\xe9 \u2713'
    assert (end.outcome, end.trial_id, end.seq) == ('aborted', 't', 2)
    assert abs(end.wall_time - time.time()) < 60


def test_no_event_is_lost_at_full_speed(tmp_path, source):
    # so that the machine must wait
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail, max_events=50)
    recorder.attach(source)
    trial(source, 'fast', steps=20_000)
    assert recorder.close(60.0)
    assert numbers(finished(tmp_path)[0]) == list(range(20_002))
    assert recorder.losses.events == 0


def test_events_of_many_threads_are_all_recorded(recorder, source, tmp_path):
    trial(source, 'threads', steps=0, end=False)

    def emit():
        for _ in range(500):
            source.emit(EventKind.STATE_START, 'TOP')

    threads = [threading.Thread(target=emit) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    recorder.close(20.0)
    assert numbers(finished(tmp_path)[0]) == list(range(4001))


def test_two_machines_at_a_time_have_a_bag_each(recorder, source, tmp_path):
    other = EventSource(pytest.fail)
    recorder.attach(other)
    trial(source, 'outer', end=False)
    trial(other, 'inner')
    source.emit(EventKind.TRIAL_END, 'TOP', outcome='done')
    recorder.close(10.0)
    by_id = {events(path)[0].trial_id: numbers(path) for path in finished(tmp_path)}
    assert by_id == {'outer': list(range(5)), 'inner': list(range(5))}


def test_attaching_a_machine_twice_records_it_once(recorder, source, tmp_path):
    recorder.attach(source)
    trial(source, 't', steps=1)
    recorder.close(10.0)
    assert numbers(finished(tmp_path)[0]) == [0, 1, 2]


def test_a_container_is_attached_by_its_events(tmp_path, source):
    class FakeContainer:
        events = source

    recorder = TrialRecorder(str(tmp_path))
    recorder.attach(FakeContainer())
    trial(source, 't')
    recorder.close(10.0)
    assert len(finished(tmp_path)) == 1


def test_closing_in_mid_trial_leaves_a_whole_bag(recorder, source, tmp_path):
    trial(source, 'cut short', end=False)
    assert recorder.close(10.0)
    assert numbers(finished(tmp_path)[0]) == [0, 1, 2, 3]


def test_a_trial_that_never_said_it_ended_is_closed_by_the_next(recorder, source, tmp_path):
    trial(source, 'silent', end=False)
    trial(source, 'next', end=False)
    assert wait_for(lambda: finished(tmp_path))
    assert [events(path)[0].trial_id for path in finished(tmp_path)] == ['silent']


def test_closing_twice_is_closing_once_and_later_events_do_no_harm(recorder, source, tmp_path):
    trial(source, 't')
    assert recorder.close(10.0) and recorder.close(10.0)
    trial(source, 'too late')
    assert len(finished(tmp_path)) == 1


def test_events_reach_the_disk_within_a_second_also_when_nothing_follows(
    recorder, source, tmp_path
):
    trial(source, 'slow', end=False)

    def written():
        return any(b'/oracle/events' in Path(path).read_bytes() for path in active(tmp_path))

    assert wait_for(written, 5.0), '0.3 s on an idle machine'


def test_one_event_that_cannot_be_converted_costs_only_itself(tmp_path, source):
    warnings = []
    recorder = TrialRecorder(str(tmp_path), warn=warnings.append)
    recorder.attach(source)
    trial(source, 't', steps=0, end=False)
    source.emit(EventKind.WARNING, 'TOP', rate='not a number')
    source.emit(EventKind.TRIAL_END, 'TOP', outcome='done')
    recorder.close(10.0)
    assert numbers(finished(tmp_path)[0]) == [0, 2]
    assert recorder.losses.events == 1 and 'not a number' in warnings[0]


def test_rates_are_recorded_at_the_start_and_at_the_end_of_a_trial(tmp_path, source):
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail)
    taken = []

    def rates():
        taken.append(threading.current_thread())
        return OracleRates(trial_id='take {}'.format(len(taken)))

    recorder.attach(source, {'~oracle/rates': rates})
    trial(source, 't')
    recorder.close(10.0)
    assert [item.trial_id for item in messages(finished(tmp_path)[0], '/oracle/rates')] == [
        'take 1',
        'take 2',
    ]
    assert taken == [threading.current_thread()] * 2


def test_rates_that_cannot_be_had_cost_no_event(tmp_path, source):
    warnings = []
    recorder = TrialRecorder(str(tmp_path), warn=warnings.append)
    recorder.attach(source, {'~oracle/rates': lambda: 1 / 0})
    trial(source, 't', steps=0)
    recorder.close(10.0)
    assert numbers(finished(tmp_path)[0]) == [0, 1]
    assert 'ZeroDivisionError' in warnings[0]


def test_what_keeps_failing_in_each_trial_is_said_once(tmp_path, source):
    warnings = []

    def full(status):
        raise OSError('no room')

    recorder = TrialRecorder(str(tmp_path), warn=warnings.append, on_status=full)
    recorder.attach(source, {'~oracle/rates': lambda: 1 / 0})
    for number in range(3):
        trial(source, 't{}'.format(number), steps=0)
    recorder.close(10.0)
    assert sorted(text[:12] for text in warnings) == ['No /oracle/r', 'Recorder sta']


def test_the_last_words_of_a_bag_tell_what_was_lost(recorder, source, tmp_path):
    trial(source, 't')
    recorder.close(10.0)
    (status,) = messages(finished(tmp_path)[0], '/record/status')
    assert (status.trial_id, status.events_written, status.events_lost) == ('t', 5, 0)
    assert status.file == finished(tmp_path)[0]


def test_a_forked_child_does_not_touch_its_parents_bag(recorder, source, tmp_path):
    trial(source, 't', steps=1, end=False)
    child = multiprocessing.get_context('fork').Process(
        target=lambda: [source.emit(EventKind.STATE_START, 'TOP') for _ in range(5000)]
    )
    child.start()
    child.join(30.0)
    assert child.exitcode == 0
    source.emit(EventKind.TRIAL_END, 'TOP')
    recorder.close(10.0)
    assert numbers(finished(tmp_path)[0]) == [0, 1, 2]


def test_a_folder_that_cannot_be_made_is_refused_at_the_start(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(OSError):
        TrialRecorder(str(tmp_path / 'file' / 'bags'))


def test_two_recorders_share_a_folder(tmp_path):
    first, second = (TrialRecorder(str(tmp_path), warn=pytest.fail) for _ in range(2))
    machine = FakeMachine(first)
    machine._trial_id = 'half'
    machine.emit(EventKind.TRIAL_START)
    # must not take the first one's bag for a dead one's
    third = TrialRecorder(str(tmp_path), warn=pytest.fail)
    play(second, 3)
    machine.emit(EventKind.TRIAL_END)
    for recorder in (first, second, third):
        assert recorder.close(10.0)
    assert len(finished(tmp_path)) == 4
    assert all(numbers(path) == list(range(len(numbers(path)))) for path in finished(tmp_path))


def message(text, when, latching=False, topic='/talk'):
    return MessageItem(topic, STRING, string_data(text), when, latching, '/someone')


def test_latched_messages_from_before_a_trial_are_in_its_bag(recorder, source, tmp_path):
    recorder._take_message(message('the map', Moment(None, 5.0), latching=True, topic='/map'))
    recorder._take_message(message('passing', Moment(None, 5.0)))
    trial(source, 'a')
    trial(source, 'b')
    recorder.close(10.0)
    for path in finished(tmp_path):
        assert [item.data for item in messages(path, '/map')] == ['the map']
        assert messages(path, '/talk') == []


def structure(path, *children):
    item = SmachContainerStructure(path=path, children=children)
    item.header.frame_id = 'any'
    kind = MessageType(item._type, item._md5sum, item._full_text)
    return MessageItem(
        '/robot/smach/container_structure',
        kind,
        serialise(item),
        Moment(None, 5.0),
        False,
        '/robot',
    )


def test_every_bag_knows_the_latest_structure_of_each_container(recorder, source, tmp_path):
    for item in (structure('TOP', 'A'), structure('TOP/SUB', 'X'), structure('TOP', 'A', 'B')):
        recorder._take_message(item)
    trial(source, 'a')
    trial(source, 'b')
    recorder.close(10.0)
    for path in finished(tmp_path):
        found = {
            item.path: item.children for item in messages(path, '/robot/smach/container_structure')
        }
        assert found == {'TOP': ['A', 'B'], 'TOP/SUB': ['X']}


def test_while_late_messages_are_waited_for_the_end_is_on_the_disk(
    recorder, source, tmp_path, monkeypatch
):
    monkeypatch.setattr(recorder_bag, 'FLUSH_AFTER_S', 60.0)
    recorder._bags._late_s = 60.0  # as where topics are recorded, and longer

    def on_the_disk(text):
        return wait_for(lambda: any(text in Path(path).read_bytes() for path in active(tmp_path)))

    trial(source, 'a', end=False)
    assert on_the_disk(b'recovers')
    source.emit(EventKind.TRIAL_END, 'TOP', outcome='succeeded')
    assert on_the_disk(b'succeeded')
    recorder._take_message(message('late', Moment(None, 5.0)))
    recorder._take_message(message('the map', Moment(None, 5.0), latching=True, topic='/map'))
    recorder._take_message(structure('TOP', 'NEXT'))
    trial(source, 'b', end=False)
    assert wait_for(lambda: finished(tmp_path))  # the next trial closes it
    recorder.close(10.0)
    first, second = finished(tmp_path)
    topics = ('/talk', '/map', '/robot/smach/container_structure')
    assert [[len(messages(path, topic)) for topic in topics] for path in (first, second)] == [
        [1, 0, 0],
        [0, 1, 1],
    ]


def test_other_topics_are_dropped_and_counted_before_an_event_is(tmp_path):
    queue = RecorderQueue(max_events=10, max_message_bytes=25)
    accepted = [queue.put_message(message('x' * 6, Moment(None, 0.0))) for _ in range(4)]
    assert accepted == [True, True, False, False]
    assert queue.put_event('event', lambda: False)
    assert [getattr(item, 'topic', item) for item in queue.take(0.0)[0]] == [
        '/talk',
        '/talk',
        'event',
    ]


def test_a_bag_keeps_to_the_clock_with_which_it_began(tmp_path):
    how = (recorder_bag.DiskWatch(5.0), recorder_bag.SyncBudget())
    simulated = recorder_bag.TrialBag(str(tmp_path), 'sim', Moment((12, 5), 1e9), *how)
    assert [simulated.stamp(Moment((13, 0), 2e9)), simulated.stamp(Moment(None, 3e9))] == [
        (13, 0),
        (13, 0),
    ]
    wall = recorder_bag.TrialBag(str(tmp_path), 'wall', Moment(None, 1e9), *how)
    assert wall.stamp(Moment((13, 0), 1e9 + 0.5)) == (10**9, 500_000_000)
    simulated.close()
    wall.close()


def test_waiting_for_the_disk_takes_a_tenth_of_the_time():
    budget = recorder_bag.SyncBudget(share=0.1)
    assert budget.affordable()
    began = time.monotonic()
    budget.spend(lambda: time.sleep(0.02))  # a disk that takes its time
    assert not budget.affordable()
    assert wait_for(budget.affordable)
    assert time.monotonic() - began >= 0.2


def test_a_waiting_machine_goes_on_when_the_recorder_is_closed():
    queue = RecorderQueue(max_events=1, max_message_bytes=0)
    assert queue.put_event('first', lambda: True)
    results = []
    machine = threading.Thread(
        target=lambda: results.append(queue.put_event('second', lambda: True))
    )
    machine.start()
    queue.close(0.0)
    machine.join(10.0)
    assert results == [False]


def test_a_signal_handler_that_strikes_inside_the_queue_can_close_the_recorder(
    recorder, source, tmp_path
):
    trial(source, 't', end=False)
    with recorder._queue._changed:
        assert recorder.close(10.0)
    assert numbers(finished(tmp_path)[0]) == [0, 1, 2, 3]


def record_until_told_to_stop(folder):
    source, recorder = EventSource(print), TrialRecorder(folder)
    recorder.attach(source)
    signal.signal(signal.SIGTERM, lambda *_: os._exit(0 if recorder.close(20.0) else 3))
    trial(source, 't', steps=10**9)


@pytest.mark.parametrize('after_s', [0.2, 0.35, 0.5, 0.65])
def test_sigterm_at_full_speed_leaves_a_closed_bag(tmp_path, after_s):
    child = multiprocessing.get_context('fork').Process(
        target=record_until_told_to_stop, args=(str(tmp_path),)
    )
    child.start()
    assert wait_for(lambda: active(tmp_path))
    time.sleep(after_s)  # any moment will do: it is what this test is about
    os.kill(child.pid, signal.SIGTERM)
    child.join(30.0)
    assert child.exitcode == 0 and active(tmp_path) == []
    (path,) = finished(tmp_path)
    assert numbers(path) == list(range(len(numbers(path)))) and len(numbers(path)) > 100
