"""What recorded trials teach: read from bags, written for a machine, and explained in words."""

import json
import random

import pytest
import yaml
from failing_machines import KEPT, NoWait, by_trial, record, run

import smach
from smach_oracle.analysis.learning import command
from smach_oracle.analysis.learning.record import read_record
from smach_oracle.analysis.learning.suggestions import (
    as_yaml,
    fisher_exact,
    holm,
    suggested,
    useless,
)
from smach_oracle.analysis.learning.words import explained
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.decision.ways import BY_PERSON, FIRST, LATER, WayResult
from smach_oracle.oracle.machine.nesting import nodes_of
from smach_oracle.oracle.records.events import EventKind

ARM = 'the left arm hides part of the picture'


class Detects(smach.State):
    """Fails while an arm hides the picture, and says so."""

    def __init__(self, generator, share):
        super().__init__(outcomes=['succeeded', 'aborted'])
        self.generator = generator
        self.share = share
        self.hidden = False

    def begin(self):
        self.hidden = self.generator.random() < self.share

    def execute(self, userdata):
        return 'aborted' if self.hidden else 'succeeded'


class MovesAway(smach.State):
    """Moves the arms away, where it runs for the second time in a trial."""

    def __init__(self, detects):
        super().__init__(outcomes=['succeeded', 'aborted'])
        self.detects = detects
        self.visits = 0

    def execute(self, userdata):
        self.visits += 1
        self.detects.hidden = self.detects.hidden and self.visits < 2
        return 'succeeded'


def hidden_machine(seed=1, share=0.5, preconditions=None, **settings):
    detects = Detects(random.Random(seed), share)
    moves = MovesAway(detects)
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('MOVE_ARMS_ASIDE', moves, {'succeeded': 'DETECT'})
        smach.StateMachine.add('DETECT', detects, {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', Detects(random.Random(seed + 1), 0.0))
    OracleContainer.wrap(
        machine,
        name='TOP',
        preconditions=preconditions or {},
        settings={'policy': 'any_way', **settings},
    )
    oracle = oracle_of(machine)
    oracle.waiting = NoWait()
    oracle.describe_failure = lambda state: ARM
    return machine


def run_hidden(machine, count):
    events = []
    machine.events.observers.append(events.append)
    detects, moves = (machine.get_children()[name] for name in ('DETECT', 'MOVE_ARMS_ASIDE'))
    for _ in range(count):
        detects.begin()
        moves.visits = 0
        machine.execute()
    return by_trial(events)


def result(way, helped, kind='step_back', place=FIRST, failure='failing_outcome aborted: ' + ARM):
    return WayResult(way, kind, place, failure, helped, 0.1)


# -- the command


def test_a_machine_begins_with_what_was_learned_and_has_what_it_would_have_learned(
    tmp_path, capsys
):
    machine = hidden_machine()
    record(tmp_path / 'bags', run_hidden(machine, 40))
    model = tmp_path / 'model.json'
    capsys.readouterr()
    assert command.main([str(tmp_path / 'bags'), '--rates-file', str(model)]) == 0
    assert capsys.readouterr().out.startswith('# TOP: 40 trials, ')
    again = hidden_machine(rates_file=str(model))
    again.execute()  # nothing fails in it: no arm hides the picture
    for node, other in zip(nodes_of(machine), nodes_of(again)):
        for label, known in node.records.by_label.items():
            taken = other.records.by_label[label]
            assert [each._replace(minutes=0) for each in taken.ways_so_far()] == [
                each._replace(minutes=0) for each in known.ways_so_far()
            ]
            successes, failures = known.totals
            assert taken.totals == (successes + 1, failures)


def test_a_state_is_explained_in_words(tmp_path, capsys):
    record(tmp_path, run_hidden(hidden_machine(), 60))
    assert command.main([str(tmp_path), '--explain', 'DETECT']) == 0
    line = next(each for each in capsys.readouterr().out.splitlines() if each.startswith('DETECT'))
    assert line.startswith("DETECT, '{}': ".format(ARM))
    counts = {
        part.rpartition(' of ')[0].rpartition(' ')[0]: part.split()[-3::2]
        for part in line.partition(': ')[2].split(', ')
    }
    helped, known = counts['from MOVE_ARMS_ASIDE']
    assert helped == known and int(known) > 10
    assert counts['entering again'][0] == '0'


def test_results_that_nobody_knows_and_choices_of_a_person_are_told_apart():
    rows = [result('again', False, 'again')] * 7 + [result('from MOVE_ARMS_ASIDE', True)] * 6
    assert explained('DETECT', rows) == [
        "DETECT, 'the left arm hides part of the picture': entering again 0 of 7, from "
        'MOVE_ARMS_ASIDE 6 of 6'
    ]
    rows = [
        result('from LOOK', True, place=BY_PERSON, failure='exception'),
        result('wait 10 s', None, 'wait', failure='exception'),
        result('prepare', True, 'prepare', failure='exception'),
        result('again', False, 'again', LATER, 'fell_through lost'),
        result('again', False, 'again', FIRST, 'fell_through lost'),
    ]
    assert explained('A/B', rows) == [
        'A/B, exception: after its preconditions 1 of 1, from LOOK 1 of 1 by a person, 1 with an '
        'unknown result',
        'A/B, lost: entering again 0 of 2',
    ]


def test_the_record_suggests_the_precondition_that_cures(tmp_path, capsys):
    record(tmp_path, run_hidden(hidden_machine(), 60))
    capsys.readouterr()
    assert command.main([str(tmp_path)]) == 0
    settings = yaml.safe_load(capsys.readouterr().out)
    assert settings == {'states': {'DETECT': {'preconditions': ['MOVE_ARMS_ASIDE']}}}
    # and the machine takes them: the failure is cured by them
    machine = hidden_machine(policy='prose', **settings)
    (trial,) = run_hidden(machine, 1)
    while not any(event.kind is EventKind.FAILURE for event in trial):
        trial = run_hidden(machine, 1)[-1]
    kinds = [event.kind for event in trial]
    assert EventKind.PRECONDITION_START in kinds and kinds.count(EventKind.FAILURE) == 1


def test_a_precondition_that_never_helped_is_named():
    trials = run_hidden(
        hidden_machine(share=0.9, preconditions={'DETECT': [lambda userdata: True]}), 60
    )
    found = read_record(trials)
    (each,) = useless(found)
    assert each.state == 'DETECT' and each.results >= 9
    lines = as_yaml(found)
    assert 'may go' in lines[-2] and lines[-1].startswith('#   DETECT: ')
    assert yaml.safe_load('\n'.join(lines))['states']['DETECT']['preconditions'][-1] == (
        'MOVE_ARMS_ASIDE'
    )


def test_chance_alone_suggests_nothing_in_most_records():
    wrong, found = 0, read_record(run_hidden(hidden_machine(), 3))
    for seed in range(40):
        generator = random.Random(seed)
        rows = {
            'S{}'.format(number): [
                result(way, generator.random() < 0.4, kind)
                for _ in range(12)
                for way, kind in (('again', 'again'), ('from A', 'step_back'), ('from B', 'top'))
            ]
            for number in range(6)
        }
        wrong += bool(suggested(found._replace(results=rows)))
    assert wrong <= 4  # of 40, 5% of which may be


def test_a_choice_of_a_person_suggests_nothing():
    found = read_record(run_hidden(hidden_machine(), 3))
    rows = [result('again', False, 'again')] * 9
    rows += [result('from A', True, place=BY_PERSON)] * 9
    assert not suggested(found._replace(results={'S': rows}))


@pytest.mark.parametrize(
    'state, way, named',
    [
        ('IN/B', 'from A', 'A'),
        ('IN/B', 'from /KITCHEN/LOOK', 'KITCHEN/LOOK'),
        ('IN/B', 'from /HOME', '/HOME'),
        ('B', 'from HOME', 'HOME'),
    ],
)
def test_a_state_elsewhere_is_named_as_a_precondition_names_it(state, way, named):
    found = read_record(run_hidden(hidden_machine(), 3))
    rows = [result('again', False, 'again')] * 9 + [result(way, True)] * 9
    (each,) = suggested(found._replace(results={state: rows}))
    assert each.precondition == named


def test_fishers_test_and_holms_correction():
    # the tea that R. A. Fisher had tasted: 3 of 4 against 1 of 4
    assert fisher_exact((3, 4), (1, 4)) == pytest.approx(17 / 70)
    assert fisher_exact((6, 6), (0, 7)) == pytest.approx(1 / 1716)
    assert fisher_exact((0, 5), (5, 5)) == 1.0
    assert holm([0.01, 0.04, 0.03]) == [True, False, False]
    assert holm([0.01, 0.02, 0.03]) == [True, True, True]
    assert holm([]) == []


# -- what it refuses


def refused(arguments, capsys):
    assert command.main(arguments) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith(('learn: ', 'Skipped '))
    return err


def test_folders_without_bags_are_refused(tmp_path, capsys):
    assert 'no such folder' in refused([str(tmp_path / 'no')], capsys)
    assert 'no bags' in refused([str(tmp_path)], capsys)


def test_records_without_menus_are_refused(tmp_path, capsys):
    record(tmp_path, run(5, **KEPT))
    capsys.readouterr()
    err = refused([str(tmp_path), '--rates-file', str(tmp_path / 'model.json')], capsys)
    assert 'no decision there has a menu' in err and 'escalating' in err
    assert not (tmp_path / 'model.json').exists()


def test_bags_that_cannot_be_read_are_named(tmp_path, capsys):
    record(tmp_path, run_hidden(hidden_machine(), 5))
    (tmp_path / 'broken.bag').write_bytes(b'#ROSBAG V2.0\nnothing more')
    capsys.readouterr()
    assert command.main([str(tmp_path)]) == 1
    assert 'Skipped {}'.format(tmp_path / 'broken.bag') in capsys.readouterr().err
    for bag in tmp_path.glob('*.bag'):
        bag.write_bytes(b'#ROSBAG V2.0\nnothing more')
    assert 'no trials with an oracle' in refused([str(tmp_path)], capsys)


def test_trials_of_several_machines_are_refused(tmp_path, capsys):
    record(tmp_path / 'a', run_hidden(hidden_machine(), 2))
    other = run_hidden(hidden_machine(), 2)
    renamed = [
        [event._replace(path=event.path.replace('TOP', 'OTHER')) for event in trial]
        for trial in other
    ]
    record(tmp_path / 'b', renamed)
    capsys.readouterr()
    err = refused([str(tmp_path)], capsys)
    assert 'several machines: TOP, OTHER. Name the folders of one' in err


def test_a_file_that_is_there_stays_and_one_that_cannot_be_written_is_told(tmp_path, capsys):
    record(tmp_path / 'bags', run_hidden(hidden_machine(), 3))
    capsys.readouterr()
    (tmp_path / 'model.json').write_text('mine')
    bags = str(tmp_path / 'bags')
    err = refused([bags, '--rates-file', str(tmp_path / 'model.json')], capsys)
    assert 'is there already' in err and (tmp_path / 'model.json').read_text() == 'mine'
    assert 'No such file' in refused(
        [bags, '--rates-file', str(tmp_path / 'no' / 'm.json')], capsys
    )


def test_a_state_that_is_not_there_is_told(tmp_path, capsys):
    record(tmp_path, run_hidden(hidden_machine(), 3))
    capsys.readouterr()
    assert "'DETEKT': no trial has visited" in refused(
        [str(tmp_path), '--explain', 'DETEKT'], capsys
    )


def test_the_file_is_a_rates_file_of_the_known_format(tmp_path):
    record(tmp_path / 'bags', run_hidden(hidden_machine(), 20))
    model = tmp_path / 'model.json'
    assert command.main([str(tmp_path / 'bags'), '--rates-file', str(model)]) == 0
    content = json.loads(model.read_text())
    assert content['format'] == 'smach_oracle rates' and content['version'] == 1
    assert set(content['containers']['']) == {'MOVE_ARMS_ASIDE', 'DETECT', 'PLACE'}
    assert content['containers']['']['DETECT']['ways']


def test_the_older_name_of_the_option_still_works(tmp_path, capsys):
    model = tmp_path / 'model.json'
    model.write_text('mine')
    err = refused([str(tmp_path), '--output', str(model)], capsys)
    assert 'learn: --output is now called --rates-file\n' in err and 'is there already' in err
