"""What another oracle would have decided: replayed from the events of real machines."""

import json
import random

import pytest
from failing_machines import KEPT, Chance, Hand, by_trial, record, run

import smach
from smach_oracle.analysis import what_if
from smach_oracle.analysis.bag_events import BagError
from smach_oracle.analysis.replaying import menus, replay
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind


def compare(trials, settings):
    return what_if.compare(what_if.Recorded(trials), settings)


@pytest.mark.parametrize(
    'settings',
    [
        {},
        {'memory': 2},
        {'policy': 'algorithm1'},
        {'estimator': 'exponential'},
        {'policy': 'restart'},
        {'policy': {'name': 'retry', 'times': 1}},
        {'policy': {'name': 'ladder', 'wait_s': 0}},
        {'policy': 'always_ask'},
        {'policy': 'escalating'},
        {'policy': 'learned'},
        {'policy': 'escalating', 'cost': {'expert_minute': 0, 'robot_minute': 0}},
        {'max_recoveries': 1},
        {'prior': 0.5, 'moderate_from': 0.3, 'high_from': 0.6},
    ],
)
def test_under_its_own_settings_every_decision_is_the_recorded_one(settings):
    tried = compare(run(60, **{**KEPT, **settings}), {})
    assert sum(tried.counts.values()) > 20
    assert tried.counts['same'] + tried.counts['not known'] == sum(tried.counts.values())
    assert tried.counts['not known'] == 0, (
        'preconditions that were not run are needed by nobody here'
    )


def test_so_it_is_of_the_branches_of_concurrences_and_iterators():
    # each draws by itself, since the branches of a Concurrence run at once
    left, right, each = (Chance(random.Random(seed), 0.5) for seed in (1, 2, 3))
    concurrence = smach.Concurrence(
        ['succeeded', 'aborted'],
        'aborted',
        outcome_map={'succeeded': {'LEFT': 'succeeded', 'RIGHT': 'succeeded'}},
    )
    with concurrence:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', right)
    iterator = smach.Iterator(
        ['succeeded', 'aborted'],
        [],
        [],
        it=[1, 2, 3],
        it_label='item',
        exhausted_outcome='succeeded',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', each, loop_outcomes=['succeeded'])
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('BOTH', concurrence, {'succeeded': 'ALL'})
        smach.StateMachine.add('ALL', iterator)
    OracleContainer.wrap(
        machine, name='TOP', expert=Hand(random.Random(4)), settings=dict(KEPT, prior=0.3)
    )
    events = []
    machine.events.observers.append(events.append)
    for _ in range(40):
        machine.execute()
    ids = list(dict.fromkeys(event.trial_id for event in events))
    tried = compare(
        [[event for event in events if event.trial_id == trial_id] for trial_id in ids], {}
    )
    assert sum(tried.counts.values()) > 20
    assert tried.counts['same'] == sum(tried.counts.values())


@pytest.mark.parametrize(
    'settings',
    [
        {'on_retry': 'confirm'},
        {'states': {'PICK': {'on_retry': 'never'}}},
        {'budget': {'recoveries': 1}},
        {'budget': {'recoveries': 2, 'questions': 1}},
    ],
)
def test_so_it_is_where_states_are_not_repeated_and_a_budget_is_spent(settings):
    trials = run(60, back_to='LOOK', **settings)
    held_back = [
        event
        for trial in trials
        for event in trial
        if event.kind is EventKind.DECISION and event.data['decided_by'] == 'held_back'
    ]
    assert bool(held_back) == ('budget' not in settings)
    tried = compare(trials, {})
    assert sum(tried.counts.values()) > 20
    assert tried.counts['same'] + tried.counts['not known'] == sum(tried.counts.values())


@pytest.mark.parametrize('author_recovers', [False, True])
def test_what_was_not_counted_changes_no_replayed_decision(author_recovers, monkeypatch):
    generator = random.Random(7)
    if author_recovers:
        add = smach.StateMachine.add

        def add_with_recovery(label, state, transitions=None, **more):
            if label == 'PICK':
                transitions = dict(transitions, aborted='LOOK')
            return add(label, state, transitions, **more)

        monkeypatch.setattr(smach.StateMachine, 'add', staticmethod(add_with_recovery))
    trials = run(40, health=lambda: generator.random() < 0.6, health_settle_s=0)
    events = [event for trial in trials for event in trial]
    assert any(event.kind == EventKind.HEALTH_WAIT_START for event in events)
    assert author_recovers == any(
        event.kind == EventKind.TRANSITION and event.data for event in events
    )
    tried = compare(trials, {})
    assert tried.counts['same'] == sum(tried.counts.values()) > 5


def test_a_state_that_ends_while_its_machine_is_preempted_has_not_succeeded_by_a_failing_outcome():
    """Whatever its failing outcome: it may have ended by the preempt."""
    generator = random.Random(5)
    pick = Chance(generator, 0.6)
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('PICK', pick, {'succeeded': 'PLACE'})
        smach.StateMachine.add('PLACE', Chance(generator, 0.3))
    OracleContainer.wrap(machine, name='TOP', expert=Hand(generator), settings=KEPT)
    execute = pick.execute

    def preempted_now_and_then(userdata):
        if generator.random() < 0.3:
            machine.request_preempt()
        return execute(userdata)

    pick.execute = preempted_now_and_then
    events = []
    machine.events.observers.append(events.append)
    for _ in range(40):
        machine.execute()
        machine.recall_preempt()
    ended_so = {
        after.outcome
        for before, after in zip(events, events[1:])
        if before.kind is EventKind.PREEMPT and after.kind is EventKind.TRANSITION
    }
    assert 'aborted' in ended_so
    tried = compare(by_trial(events), {})
    assert tried.counts['same'] == sum(tried.counts.values()) > 20


def test_an_oracle_that_forgets_at_once_asks_where_the_recorded_one_recovered():
    trials = run(60)
    tried = compare(trials, {'memory': 1})
    assert tried.counts['would ask'] > 5 and tried.counts['would recover'] == 0
    assert 0 < tried.other_trials <= tried.trials == 60


def test_what_was_not_tried_is_not_known():
    trials = run(60, memory=1)  # every failure is HIGH: no precondition was run, if there are any
    tried = compare(trials, {'memory': 50})
    assert tried.counts['not known'] > 5 and tried.counts['would recover'] == 0
    assert (
        tried.other_trials
        <= sum(tried.counts.values()) - tried.counts['same'] - tried.counts['not known']
    )


def test_an_oracle_that_forgets_nothing_recovers_where_the_recorded_one_asked():
    assert compare(run(60, memory=2), {'memory': 50}).counts['would recover'] > 5


def test_a_record_that_does_not_replay_is_refused():
    with pytest.raises(BagError, match='state may have settings of its own'):
        compare(run(60, states={'PICK': {'memory': 3}}), {'memory': 5})
    with pytest.raises(BagError, match='trials may be missing'):
        compare(run(60)[5:], {'memory': 5})


def test_programs_that_began_with_nothing_learned_are_told_by_the_rates():
    parts = [run(count, seed=count, back_to='PICK') for count in (1, 6, 1, 2, 9)]
    apart = [compare(part, {'memory': 2}) for part in parts]
    joined = compare([trial for part in parts for trial in part], {'memory': 2})
    assert joined.programs == len(parts)
    assert joined.counts == {
        name: sum(part.counts[name] for part in apart) for name in apart[0].counts
    }
    assert what_if.format_tried_settings([joined]).endswith(
        '\nat least 5 programs, each of which began with nothing learned\n'
    )


def test_a_program_whose_first_failures_fit_a_later_beginning_is_found():
    """Its first trial, which Ctrl-C has stopped, has only taught it that LOOK succeeds."""
    first = run(9, seed=1)
    for seed in range(200):
        second = run(30, seed=seed, stopped=1)
        failed = [
            [event.state for event in trial if event.kind == EventKind.FAILURE] for trial in second
        ]
        if failed[1][:1] == ['PICK'] and any('LOOK' in states for states in failed[2:9]):
            break
    joined = compare(first + second, {})
    assert joined.programs == 2 and joined.counts['same'] == sum(
        compare(part, {}).counts['same'] for part in (first, second)
    )


def test_what_cannot_be_replayed_is_named_and_the_rest_is(tmp_path, capsys):
    told = run(3)
    untold = [
        [
            event._replace(data={'recovers': True})
            if event.kind == EventKind.TRIAL_START
            else event
            for event in trial
        ]
        for trial in run(3, seed=2)
    ]
    record(tmp_path / 'a', untold)
    record(tmp_path / 'b', told)
    (tmp_path / 'b' / 'trial.bag.active').write_bytes(b'')
    capsys.readouterr()
    assert what_if.main([str(tmp_path), '--memory', '5']) == 1
    out, err = capsys.readouterr()
    assert (
        out.startswith(str(tmp_path / 'b') + '\n')
        and ' of 3\n' in out
        and str(tmp_path / 'a') not in out
    )
    assert 'Skipped {}: its trials do not tell the settings'.format(tmp_path / 'a') in err
    assert 'Skipped {}: still being'.format(tmp_path / 'b' / 'trial.bag.active') in err
    assert what_if.main([str(tmp_path / 'a')]) == 2
    assert 'no trials with an oracle that could be replayed' in capsys.readouterr().err
    assert what_if.main([str(tmp_path / 'b'), '--memory', '0']) == 2
    assert 'memory' in capsys.readouterr().err


def test_the_command(tmp_path, capsys):
    record(tmp_path, run(40))
    capsys.readouterr()
    assert (
        what_if.main([str(tmp_path), '--memory', '1', '10', '--policy', 'prose', 'algorithm1']) == 0
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == str(tmp_path) and len(lines) == 7
    row = next(line for line in lines if line.startswith('memory 10, policy prose'))
    assert row.split()[4] == row.split()[5] and row.endswith('   0 of 40'), 'as recorded'
    assert what_if.main([str(tmp_path / 'nowhere')]) == 2
    assert 'no such folder' in capsys.readouterr().err


def test_another_estimator_can_be_tried(tmp_path, capsys):
    record(tmp_path, run(40))
    capsys.readouterr()
    assert what_if.main([str(tmp_path), '--estimator', 'window', 'exponential']) == 0
    lines = capsys.readouterr().out.splitlines()
    as_recorded, other = (
        next(line for line in lines if line.startswith('estimator ' + name))
        for name in ('window', 'exponential')
    )
    assert as_recorded.endswith('   0 of 40') and not other.endswith('   0 of 40')


def test_the_tables_as_json_are_those_that_are_printed(tmp_path, capsys):
    record(tmp_path / 'bags', run(40))
    capsys.readouterr()
    assert (
        what_if.main(
            [str(tmp_path / 'bags'), '--memory', '1', '10', '--json', str(tmp_path / 'out.json')]
        )
        == 0
    )
    lines = capsys.readouterr().out.splitlines()[3:]
    told = json.loads((tmp_path / 'out.json').read_text())
    (folder,) = told['folders']
    assert folder['folder'] == str(tmp_path / 'bags') and told['skipped'] == []
    assert [each['settings'] for each in folder['tried']] == [{'memory': 1}, {'memory': 10}]
    for line, tried in zip(lines, folder['tried']):
        numbers = [int(word) for word in line.split()[2:] if word.isdigit()]
        shown = [tried['outcomes'][name] for name in what_if.OUTCOMES]
        assert numbers == [
            tried['decisions'],
            *shown,
            tried['trials_with_another'],
            tried['trials'],
        ]


def test_json_that_cannot_be_written_is_told_in_one_line(tmp_path, capsys):
    record(tmp_path, run(3))
    capsys.readouterr()
    assert what_if.main([str(tmp_path), '--json', str(tmp_path / 'no' / 'out.json')]) == 2
    assert 'no/out.json: No such file' in capsys.readouterr().err


def tried_under(recorded, settings):
    """The counts, where what one policy recorded is put to another."""
    return compare(run(60, **{**KEPT, 'policy': recorded}), settings).counts


def test_what_is_drawn_is_not_known():
    counts = tried_under('prose', {'policy': 'random'})
    assert counts['not known'] == sum(counts.values()) > 20
    counts = tried_under('random', {})
    assert counts['not known'] > 20
    # what the limits outside every policy have decided is known
    assert counts['not known'] + counts['same'] == sum(counts.values())


def test_a_policy_that_asks_nobody_would_give_up():
    counts = tried_under('always_ask', {'policy': 'retry'})
    assert counts['would recover'] == sum(counts.values()) > 20
    counts = tried_under('prose', {'policy': 'retry', 'policy.times': 0})
    assert counts[what_if.GIVES_UP] == sum(counts.values()) > 20


def test_another_policy_has_the_parameters_it_comes_with():
    recorded = run(60, **{**KEPT, 'policy': {'name': 'retry', 'times': 0}})
    counts = compare(recorded, {'policy': 'ladder'}).counts
    assert counts['would recover'] == sum(counts.values()) > 20


def test_the_column_of_those_who_give_up_is_there_where_some_do():
    recorded = run(60, **KEPT)
    rows = [
        compare(recorded, settings)
        for settings in ({'policy': 'always_ask'}, {'policy': 'retry', 'policy.times': 0})
    ]
    assert what_if.GIVES_UP in what_if.format_tried_settings(rows, wide=True)
    assert what_if.GIVES_UP not in what_if.format_tried_settings(rows[:1], wide=True)
    assert 'give up' in what_if.format_tried_settings(rows)


def test_the_table_says_the_same_in_at_most_100_columns():
    recorded = run(60, **KEPT)
    rows = [
        compare(recorded, settings)
        for settings in (
            {'policy': 'retry', 'policy.times': 0},
            {'policy': 'escalating', 'memory': 20, 'moderate_from': 0.25, 'high_from': 0.75},
        )
    ]
    narrow, wide = (what_if.format_tried_settings(rows, each) for each in (False, True))
    assert max(map(len, narrow.splitlines())) <= 100 < max(map(len, wide.splitlines()))
    assert sorted(narrow.split()) == sorted(wide.split())


# -- policies that go by ways


def test_a_policy_that_goes_by_ways_chooses_from_the_recorded_menu():
    recorded = run(60, **{**KEPT, 'policy': 'escalating'})
    dear = compare(recorded, {'cost.expert_minute': 0.0, 'cost.harm': 9e5})
    assert dear.counts['would ask'] + dear.counts['recovers otherwise'] > 5
    assert dear.counts['not known'] == dear.without_menu == 0


def test_another_order_of_ways_is_another_decision_also_where_the_action_is_the_same():
    recorded = run(60, **{**KEPT, 'policy': 'escalating'})
    taken = [event for trial in recorded for event in trial if event.kind is EventKind.DECISION]
    event = next(each for each in taken if each.outcome == 'step_back')
    for key in list(event.data['order']):
        tried = replay.ReplayedDecision('step_back', key)
        assert tried.is_as(event) is (key == event.data['order'][0])
    assert replay.ReplayedDecision('step_back').is_as(event)


def test_what_it_would_choose_is_not_known_where_no_menu_was_recorded_and_the_table_says_so():
    recorded = run(60, **KEPT)
    row = compare(recorded, {'policy': 'escalating'})
    assert row.counts['not known'] == row.without_menu == sum(row.counts.values()) > 20
    told = what_if.format_tried_settings([row])
    assert 'policy escalating: not known for' in told and 'without a menu' in told
    assert 'without a menu' not in what_if.format_tried_settings([compare(recorded, {})])


def test_the_other_policies_know_by_the_menu_which_states_have_preconditions():
    recorded = run(60, **{**KEPT, 'policy': 'escalating'})
    counts = compare(recorded, {'policy': 'prose'}).counts
    # PICK has a precondition, which may not have been run there
    assert 0 < counts['not known'] < sum(counts.values())
    assert compare(recorded, {'policy': 'always_ask'}).counts['would ask'] > 20


def test_what_the_control_draws_is_not_known_but_that_it_asks():
    recorded = run(60, **{**KEPT, 'policy': 'any_way'})
    counts = compare(recorded, {}).counts
    assert counts['not known'] > 20
    assert counts['not known'] + counts['same'] == sum(counts.values())


@pytest.mark.parametrize(
    'broken',
    [{'menu': 5}, {'menu': [{'no': 1}]}, {'streak': None}, {'order': 7}, {'attempts': 'many'}],
    ids=str,
)
def test_a_menu_that_cannot_be_read_is_none(broken):
    recorded = run(60, **{**KEPT, 'policy': 'escalating'})
    event = next(e for t in recorded for e in t if e.kind is EventKind.DECISION)
    assert menus.recorded_menu(event, {}) is not None
    spoiled = event._replace(data={**event.data, **broken})
    if 'order' in broken:
        assert menus.chosen_way(spoiled) == ''
    else:
        assert menus.recorded_menu(spoiled, {}) is None
        assert not menus.offers_preconditions(spoiled)
