"""Counts by state, from events of machines that the executive has run, and from old bags."""

import csv
import json
from pathlib import Path

import pytest
from test_way_reader import Answers, Scripted, machine_of

from smach_oracle.analysis import bag_statistics
from smach_oracle.analysis.by_state.follower import states_of
from smach_oracle.analysis.by_state.rows import FILES, VariantStates, costs_of, rows_of
from smach_oracle.analysis.by_state.state_counts import StatesOfTrials
from smach_oracle.analysis.by_state.text import format_states
from smach_oracle.analysis.trials import load_by_state
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.oracle.records.events import Event, EventKind, FailureKind

OLD_BAGS = Path(__file__).parents[2] / 'data/v0_1/trials'
GOTO_LOOK = Answer(AnswerKind.GOTO, state='LOOK', by='hand')
DONE = Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='hand')


def events_of(machine):
    events = []
    machine.events.observers.append(events.append)
    machine.execute()
    return events


def counted(machine, name='TOP/PICK'):
    found = states_of(events_of(machine))
    return found, found.states[name]


def ways_of(counts):
    return {
        words: (count.helped, count.in_vain, count.not_known)
        for words, count in counts.ways.items()
    }


def story(*steps):
    """Events a second apart: each is a kind, and fields."""
    return [
        Event(kind, 'id', number, float(number), **dict({'path': 'TOP', 'state': 'PICK'}, **fields))
        for number, (kind, fields) in enumerate(steps)
    ]


def test_visits_failures_and_ways_of_a_state():
    texts = [RuntimeError('arm 3 at 0.5 m'), RuntimeError('arm 4 at 0.25 m'), 'aborted']
    _, pick = counted(machine_of(Scripted(), Scripted(*texts)))
    assert (pick.visits, pick.failures, pick.not_recovered) == (4, 3, 0)
    assert {reason: number for (_, _, reason), number in pick.reasons.items()} == {
        'exception: RuntimeError: arm # at # m': 2,
        'fell_through aborted': 1,
    }
    assert ways_of(pick) == {
        'trying it again': (0, 1, 0),
        'trying it again after 10 s': (0, 1, 0),
        'going back to LOOK': (1, 0, 0),
    }


def test_policies_without_a_menu_have_the_same_words():
    _, pick = counted(machine_of(Scripted(), Scripted('aborted', 'aborted'), policy='restart'))
    assert ways_of(pick) == {'going back to LOOK': (1, 1, 0)}


def test_a_failure_of_a_bare_script_is_followed_by_nothing():
    failed = {'failure_kind': FailureKind.FELL_THROUGH, 'outcome': 'aborted'}
    found = states_of(
        story(
            (EventKind.TRIAL_START, {'state': '', 'data': {'recovers': False}}),
            (EventKind.STATE_START, {}),
            (EventKind.FAILURE, failed),
            (EventKind.TRANSITION, {'outcome': 'aborted', 'target': 'aborted'}),
            (EventKind.CONTAINER_END, {'state': '', 'outcome': 'aborted'}),
            (EventKind.TRIAL_END, {'state': '', 'outcome': 'aborted'}),
        )
    )
    pick = found.states['TOP/PICK']
    assert (pick.failures, pick.not_recovered, ways_of(pick)) == (1, 1, {})
    assert found.extra_visits == pick.lost_visits == 0
    assert '    nothing    ' in format_states([VariantStates('TOP', 'bare', found)])


def test_the_choice_of_an_expert_leads_on_where_its_state_succeeds_next():
    found, pick = counted(
        machine_of(Scripted(), Scripted(*['aborted'] * 4), expert=Answers(GOTO_LOOK))
    )
    assert ways_of(pick)['expert: going to LOOK'] == (1, 0, 0)
    assert (pick.answers, found.choices.helped) == ({'goto': 1}, 1)
    again = Answer(AnswerKind.GOTO, state='PICK', by='hand')
    found, pick = counted(machine_of(Scripted(), Scripted(*['aborted'] * 5), expert=Answers(again)))
    assert ways_of(pick)['expert: trying it again'] == (0, 1, 0)
    assert (found.choices.helped, found.choices.in_vain) == (0, 1)


def test_the_work_of_an_expert_leads_on_where_the_state_after_it_succeeds():
    machine = machine_of(Scripted(), Scripted(*['aborted'] * 4), expert=Answers(DONE))
    found, pick = counted(machine)
    assert ways_of(pick)['expert: did its work'] == (1, 0, 0)
    assert pick.answers == {'supersede': 1} and found.choices.helped == 1
    broken = machine_of(
        Scripted(), Scripted(*['aborted'] * 4), Scripted('aborted'), expert=Answers(DONE)
    )
    found, pick = counted(broken)
    assert found.states['TOP/INNER/REACH'].failures == 1


def test_where_the_state_does_not_run_again_the_end_of_the_trial_decides():
    steps = [
        (EventKind.TRIAL_START, {'state': ''}),
        (EventKind.STATE_START, {}),
        (EventKind.FAILURE, {'failure_kind': FailureKind.FELL_THROUGH, 'outcome': 'aborted'}),
        (EventKind.QUERY_OPENED, {'query_id': 'q'}),
        (EventKind.QUERY_CLAIMED, {'query_id': 'q', 'by': 'ann'}),
        (EventKind.QUERY_ANSWERED, {'query_id': 'q', 'outcome': 'goto', 'by': 'ann'}),
        (EventKind.JUMP, {'target': 'PLACE', 'by': 'ann'}),
    ]
    for outcome, led_on in (
        ('succeeded', (1, 0, 0)),
        ('aborted', (0, 1, 0)),
        ('parked', (0, 0, 1)),
    ):
        end = (EventKind.TRIAL_END, {'state': '', 'outcome': outcome})
        data = {'failure_rule': {'by_name': 2}}
        found = states_of(story((steps[0][0], {'state': '', 'data': data}), *steps[1:], end))
        assert ways_of(found.states['TOP/PICK']) == {'expert: going to PLACE': led_on}
        assert (found.times.to_claim, found.times.to_answer, found.times.to_resume) == (
            [1.0],
            [2.0],
            [3.0],
        )
        assert (found.expert_s, found.robot_s, found.extra_s) == (1.0, 7.0, 5.0)


def test_an_interface_after_which_the_question_is_put_again_was_in_vain():
    fields = {'query_id': 'q', 'by': 'ann'}
    found = states_of(
        story(
            (EventKind.STATE_START, {}),
            (EventKind.FAILURE, {'failure_kind': FailureKind.FELL_THROUGH}),
            (EventKind.QUERY_OPENED, {'query_id': 'q'}),
            (EventKind.QUERY_ANSWERED, dict(fields, outcome='interface', target='arm')),
            (EventKind.INTERFACE_START, dict(fields, target='arm')),
            (EventKind.INTERFACE_END, dict(fields, target='arm')),
            (EventKind.QUERY_OPENED, {'query_id': 'r'}),
            (EventKind.QUERY_EXPIRED, {'query_id': 'r'}),
        )
    )
    pick = found.states['TOP/PICK']
    assert ways_of(pick) == {'expert: interface arm': (0, 1, 0)}
    assert pick.answers == {'interface': 1, 'expired': 1}
    assert pick.ways['expert: interface arm'].seconds == 3.0
    assert found.expert_s == 3.0, 'nobody claimed it: from its opening to the end of the interface'


CLAIMED, RELEASED = EventKind.QUERY_CLAIMED, EventKind.QUERY_RELEASED


@pytest.mark.parametrize(
    'claims, outcome, expert_s',
    [
        ([], 'goto', 1.0),  # from its opening
        ([CLAIMED], 'goto', 1.0),
        ([CLAIMED, RELEASED], 'goto', 1.0),  # by somebody who never claimed it
        ([CLAIMED, RELEASED, CLAIMED], 'goto', 2.0),
        ([CLAIMED, CLAIMED], 'goto', 2.0),  # taken over
        ([CLAIMED, CLAIMED, RELEASED], 'goto', 2.0),
        ([CLAIMED, RELEASED], 'interface', 2.0),  # and the interface
        ([], 'interface', 2.0),
    ],
)
def test_the_expert_works_while_a_question_is_claimed(claims, outcome, expert_s):
    question = {'query_id': 'q'}
    found = states_of(
        story(
            (EventKind.STATE_START, {}),
            (EventKind.FAILURE, {'failure_kind': FailureKind.FELL_THROUGH}),
            (EventKind.QUERY_OPENED, question),
            *[(kind, question) for kind in claims],
            (EventKind.QUERY_ANSWERED, {'query_id': 'q', 'outcome': outcome}),
            (EventKind.INTERFACE_END, question),
            (EventKind.TRIAL_END, {'state': ''}),
        )
    )
    assert found.expert_s == expert_s
    assert found.times.to_claim == ([1.0] if claims else [])


def test_the_clock_stands_still_while_the_program_does_not_run():
    found = states_of(
        story((EventKind.STATE_START, {}), (EventKind.RESUMED, {}), (EventKind.TRIAL_END, {}))
    )
    assert found.robot_s == 1.0


@pytest.mark.parametrize(
    'steps',
    [
        [],
        [(EventKind.TRIAL_END, {'outcome': 'succeeded'})],
        [(EventKind.JUMP, {'target': 'LOOK', 'data': {'from': ''}})],
        [(EventKind.JUMP, {'target': '', 'data': 'no mapping'})],
        [(EventKind.SUPERSEDE, {}), (EventKind.JUMP, {'by': 'ann'})],
        [(EventKind.QUERY_ANSWERED, {'query_id': 'gone', 'outcome': 'goto'})],
        [(EventKind.QUERY_CLAIMED, {'query_id': 'gone'}), (EventKind.QUERY_RELEASED, {})],
        [(99, {}), (EventKind.FAILURE, {'failure_kind': 77, 'outcome': 'x'})],
        [(EventKind.QUERY_OPENED, {'query_id': 'q'})],
    ],
)
def test_a_record_that_lacks_events_is_counted_with_what_there_is(steps):
    found = states_of(story(*steps))
    assert found.trials == 1 and found.extra_s >= 0.0
    variant = VariantStates('TOP', 'with oracle', found)
    assert format_states([variant]).endswith('\n') and set(rows_of([variant])) == set(FILES)


def test_the_costs_of_nothing_are_not_known():
    costs = costs_of(StatesOfTrials())
    assert costs['extra_s_a_trial'] is None and costs['to_claim_s_median'] is None
    assert format_states([]) == ''


def test_the_counts_of_old_bags_are_those_of_the_trials():
    found, by_trial = load_by_state([str(OLD_BAGS)])
    assert len(by_trial) == len(found.trials) > 10
    for trial in found.trials:
        states = by_trial[trial.trial_id].states
        failed = {name: counts.failures for name, counts in states.items() if counts.failures}
        assert failed == dict(trial.failures_by_state)
        assert sum(counts.questions for counts in states.values()) == trial.questions


def test_the_command_prints_and_writes_it(tmp_path, capsys):
    out = [str(OLD_BAGS), '--csv', str(tmp_path / 'a.csv'), '--json', str(tmp_path / 'a.json')]
    assert bag_statistics.main(out) == 0
    plain = capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {'a.csv', 'a.json'}
    assert 'by_state' not in json.loads((tmp_path / 'a.json').read_text())
    assert bag_statistics.main([*out, '--by-state']) == 0
    text = capsys.readouterr().out
    assert text.startswith(plain) and 'FETCH, with oracle: by state\n' in text
    assert max(map(len, text[len(plain) :].splitlines())) <= 100
    data = json.loads((tmp_path / 'a.json').read_text())
    for name in FILES:
        with (tmp_path / 'a_{}.csv'.format(name)).open(newline='') as stream:
            rows = list(csv.DictReader(stream))
        assert len(rows) == len(data['by_state'][name]) > 0
        assert set(rows[0]) == set(data['by_state'][name][0])


def test_csv_files_that_cannot_be_written_are_an_error(tmp_path, capsys):
    (tmp_path / 'a_states.csv').mkdir()
    code = bag_statistics.main([str(OLD_BAGS), '--by-state', '--csv', str(tmp_path / 'a.csv')])
    assert code == 2 and 'a_states.csv' in capsys.readouterr().err
