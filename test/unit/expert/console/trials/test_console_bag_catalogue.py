"""Bags in the console: counted as the analysis counts them, bounded, broken ones named, and served
by numbers alone.
"""

import json
import os
import shutil
import sys
import tempfile
import time

import console_case
import pytest
from fake_trials import FakeMachine, play
from waiting import wait_for

from smach_oracle.analysis.trials import load_trials
from smach_oracle.analysis.variants import count_variants
from smach_oracle.expert.console.graphs.layout_worker import LayoutWorker
from smach_oracle.expert.console.sensors.question_images import ImageStore
from smach_oracle.expert.console.trials import bag_catalogue, recorded_trials
from smach_oracle.expert.console.trials.bag_catalogue import BagCatalogue, RecordedTrialError
from smach_oracle.expert.console.trials.recorded_trials import RecordedTrials
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.ros.recorder import TrialRecorder

TRIALS = 12


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Trials that the real recorder wrote."""
    return written(str(tmp_path_factory.mktemp('bags')))


def written(place, trials=TRIALS, **settings):
    recorder = TrialRecorder(place, warn=pytest.fail)
    play(recorder, trials, **settings)
    assert recorder.close(30.0)
    return place


def catalogue_of(*folders):
    sections = PageSections()
    catalogue = BagCatalogue(folders, sections)
    catalogue.scan()
    return catalogue, lambda: sections.get('bags')


def test_they_are_counted_as_the_analysis_counts_them(folder):
    _, section = catalogue_of(folder)
    found = load_trials([folder]).trials
    group = count_variants(found)[0]
    row = section()['table'][0]
    assert (row['experiment'], row['arm'], row['trials']) == (group.experiment, group.name, TRIALS)
    assert row['counts']['recoveries'] == {
        'trials': group.of('oracle recoveries').trials,
        'events': group.of('oracle recoveries').events,
    }
    assert row['endings']['failure'] == group.of('ended in failure').trials
    assert row['unwell_s'] == sum(each.unwell_s for each in found)
    assert {each['id'] for each in section()['trials']} == {each.trial_id for each in found}
    starts = [each['start'] for each in section()['trials']]
    assert starts == sorted(starts, reverse=True)
    assert not section()['broken'] and section()['waiting'] == 0


def test_a_trial_of_a_bag_whose_end_says_nothing_is_counted_apart(folder, tmp_path):
    assert 'other' not in catalogue_of(folder)[1]()['table'][0]['endings']
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail)
    machine = FakeMachine(recorder)
    machine.emit(EventKind.TRIAL_START, data={'recovers': True, 'failure_rule': {'by_name': 1}})
    machine.emit(EventKind.TRIAL_END, outcome='parked')
    assert recorder.close(30.0)
    _, section = catalogue_of(str(tmp_path))
    assert section()['table'][0]['endings']['other'] == 1


def test_nothing_of_where_they_lie_is_told_and_broken_ones_are_named(folder, tmp_path):
    shutil.copytree(folder, str(tmp_path / 'deep'))
    (tmp_path / 'deep' / 'torn.bag').write_bytes(b'#ROSBAG V2.0\n' + os.urandom(300))
    (tmp_path / 'empty.bag').write_bytes(b'')
    (tmp_path / 'old.bag.active').write_bytes(b'#ROSBAG V2.0\n')
    os.utime(str(tmp_path / 'old.bag.active'), (1, 1))
    (tmp_path / 'now.bag.active').write_bytes(b'#ROSBAG V2.0\n')
    _, section = catalogue_of(str(tmp_path), str(tmp_path / 'nowhere'))
    broken = {each['name']: each['reason'] for each in section()['broken']}
    assert sorted(broken) == ['deep/torn.bag', 'empty.bag', 'old.bag.active'], (
        'one that is being written is not broken'
    )
    assert all(reason for reason in broken.values())
    assert 'no such folder' in section()['note']
    assert len(section()['trials']) == TRIALS
    assert str(tmp_path) not in json.dumps(dict(section(), note=''))


def test_one_that_is_gone_is_forgotten_and_one_that_changes_is_read_again(folder, tmp_path):
    shutil.copytree(folder, str(tmp_path / 'copy'))
    catalogue, section = catalogue_of(str(tmp_path))
    paths = sorted((tmp_path / 'copy').glob('*.bag'))
    numbers = {each['id']: each['number'] for each in section()['trials']}
    paths[0].unlink()
    paths[1].write_bytes(b'overwritten')
    catalogue.scan()
    assert len(section()['trials']) == TRIALS - 2
    assert [each['name'] for each in section()['broken']] == ['copy/' + paths[1].name]
    assert all(numbers[each['id']] == each['number'] for each in section()['trials'])


def test_a_trial_in_two_bags_is_one(folder, tmp_path):
    for name in ('one', 'two'):
        shutil.copytree(folder, str(tmp_path / name))
    catalogue, section = catalogue_of(str(tmp_path))
    assert len(section()['trials']) == TRIALS
    trial = catalogue.find(section()['trials'][0]['number'])
    assert len(trial.summary.bags) == 2
    events = catalogue.replayed(trial, 1000).events
    assert [event.seq for event in events] == list(range(len(events)))


@pytest.mark.parametrize('end', ['removed', 'overwritten'])
def test_a_trial_that_loses_one_of_its_bags_is_read_from_the_other(folder, tmp_path, end):
    for name in ('one', 'two'):
        shutil.copytree(folder, str(tmp_path / name))
    catalogue, section = catalogue_of(str(tmp_path))
    for bag in (tmp_path / 'one').glob('*.bag'):
        bag.unlink() if end == 'removed' else bag.write_bytes(b'overwritten')
    catalogue.scan()
    if end == 'overwritten':
        catalogue.scan()  # the other bags were not due as these were found broken
    assert section()['table'][0]['trials'] == len(section()['trials']) == TRIALS
    trial = catalogue.find(section()['trials'][0]['number'])
    assert [os.path.dirname(bag) for bag in trial.summary.bags] == [str(tmp_path / 'two')]


def test_number_and_size_are_bounded(folder, monkeypatch):
    monkeypatch.setattr(bag_catalogue, 'MOST_BAGS', 5)
    monkeypatch.setattr(bag_catalogue, 'SHOWN_TRIALS', 3)
    _, section = catalogue_of(folder)
    assert section()['table'][0]['trials'] == 5 and len(section()['trials']) == 3
    assert (
        section()['note']
        == 'Of 12 bags the newest 5 are read. Of 5 trials the latest 3 are listed.'
    )
    monkeypatch.setattr(bag_catalogue, 'MOST_BYTES', 10)
    _, section = catalogue_of(folder)
    assert not section()['trials'] and 'at most' in section()['broken'][0]['reason']
    monkeypatch.setattr(bag_catalogue, 'MOST_BYTES', 2**30)
    monkeypatch.setattr(bag_catalogue, 'MOST_EVENTS', 10)
    _, section = catalogue_of(folder)
    assert 'more than 10 events' in section()['broken'][0]['reason']


def test_without_the_package_that_reads_bags_a_sentence_says_so(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, 'rosbags', None)
    sections = PageSections()
    BagCatalogue([folder], sections).run()
    assert sections.get('bags')['note']


def test_a_trial_is_read_with_its_machine_and_one_that_is_gone_says_so(folder, tmp_path):
    shutil.copytree(folder, str(tmp_path / 'copy'))
    catalogue, section = catalogue_of(str(tmp_path))
    shown = RecordedTrials(catalogue, LayoutWorker(), ImageStore())
    number = section()['trials'][0]['number']
    data = json.loads(shown.text(number))
    assert data['events'][0]['kind'] == 'trial_start' and data['events'][-1]['kind'] == 'trial_end'
    graph = data['graphs']['PICK_AND_PLACE']
    assert [state['label'] for state in graph['states']][:2] == ['MOVE_ARMS_ASIDE', 'POINT_HEAD']
    assert graph['drawn'] is bool(shutil.which('dot'))
    with pytest.raises(RecordedTrialError, match='no trial 999'):
        shown.text(999)
    shutil.rmtree(str(tmp_path / 'copy'))
    with pytest.raises(RecordedTrialError, match='is gone'):
        shown.text(section()['trials'][-1]['number'])


def test_long_trials_are_cut_and_too_large_ones_refused(folder, monkeypatch):
    monkeypatch.setattr(recorded_trials, 'MOST_EVENTS', 7)
    catalogue, section = catalogue_of(folder)
    number = section()['trials'][0]['number']
    assert (
        len(
            json.loads(RecordedTrials(catalogue, LayoutWorker(), ImageStore()).text(number))[
                'events'
            ]
        )
        == 7
    )
    monkeypatch.setattr(recorded_trials, 'MOST_BYTES', 1000)
    with pytest.raises(RecordedTrialError, match='too large'):
        RecordedTrials(catalogue, LayoutWorker(), ImageStore()).text(number)


def test_one_that_a_recorder_writes_is_left_alone(tmp_path):
    recorder = TrialRecorder(str(tmp_path), warn=pytest.fail)
    FakeMachine(recorder).emit(EventKind.TRIAL_START)
    # its recorder locks it before it writes to it
    active = wait_for(lambda: [bag for bag in tmp_path.glob('*.bag.active') if bag.stat().st_size])
    os.utime(str(active[0]), (1, 1))
    catalogue, section = catalogue_of(str(tmp_path))
    assert not section()['broken'] and not section()['trials']
    assert recorder.close(30.0)
    catalogue.scan()
    assert [each['ending'] for each in section()['trials']] == ['unfinished']


class TestServed(console_case.ConsoleCase):
    def folders(self):
        self.place = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.place)
        return [written(self.place, 1)]

    def trial(self):
        self.catalogue.scan()
        return self.sections.get('bags')['trials'][0]['number']

    def get(self, path, xsrf=True):
        if not hasattr(self, 'session'):
            self.session = self.sign_in('viewer')
        cookie, info = self.session
        return self.ask(path, Cookie=cookie, X_Xsrf=info['xsrf'] if xsrf else None)

    def test_a_viewer_replays_it(self):
        answer = self.get('/recorded/{}'.format(self.trial()))
        assert answer.code == 200 and json.loads(answer.body)['events']
        assert answer.headers['Cache-Control'] == 'no-store'

    def test_nobody_else_does(self):
        number = self.trial()
        for path in ('/recorded/{}'.format(number), '/image/1'):
            assert self.ask(path).code == 401
            assert self.get(path, xsrf=False).code == 403

    def test_a_browser_can_name_neither_path_nor_anything_but_a_number(self):
        for path in (
            '/recorded/../{}'.format(self.place),
            '/recorded/' + self.place,
            '/recorded/1e3',
            '/recorded/-1',
            '/recorded/',
            '/recorded/%2e%2e%2fetc',
            '/recorded/12345678901',
            '/image/a',
            '/image/1/2',
        ):
            assert self.get(path).code == 404, path
        assert self.get('/recorded/1?path=/etc/passwd').code == 400
        answer = self.get('/recorded/999')
        assert answer.code == 422 and self.place not in answer.body.decode()

    def test_they_are_limited_in_rate(self):
        cookie, info = self.sign_in('viewer')
        began = time.monotonic()
        codes = [self.ask('/image/1', Cookie=cookie, X_Xsrf=info['xsrf']).code for _ in range(100)]
        if time.monotonic() - began < 3.0:
            assert 429 in codes
        assert set(codes) <= {404, 429}
