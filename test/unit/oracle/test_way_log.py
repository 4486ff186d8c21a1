"""What the ways on from failures have led to: noted as a machine runs, kept beside its rates."""

import copy
import json
import random

import pytest
from machines import FakeExpert, FakeWaiting, Scripted, Watched, give_up, goto, supersede, watched

import smach
from smach_oracle.oracle import oracle_of
from smach_oracle.oracle.decision.ways import BY_PERSON, FIRST, LATER, WayResult
from smach_oracle.oracle.machine.nesting import marked_node, settle_ways
from smach_oracle.oracle.machine.state_record import FastEdge, StateRecord
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.visits import Visit, VisitResult
from smach_oracle.oracle.records.way_results import (
    MOST_FAILURES,
    MOST_RESULTS,
    WayLog,
    counts_of_kinds,
    merged_ways,
    plain_failure_key,
    results_in,
    told_of,
)
from smach_oracle.oracle.settings.settings import StateSettings

ENDS = ['done', 'aborted', 'preempted']


def machine_of(*states, expert=None, **settings):
    machine = watched(
        *states,
        settings={'policy': 'escalating', 'max_recoveries': 50, **settings},
        expert=expert,
    )
    oracle_of(machine.machine).waiting = FakeWaiting()
    return machine


def noted(machine, label):
    """(way, place, helped) of each result."""
    record = marked_node(machine.machine).record(label)
    return [(each.way, each.place, each.helped) for each in record.ways_so_far()]


# -- a machine that runs


def test_a_way_has_helped_once_the_state_succeeds_and_not_where_it_fails_again():
    machine = machine_of(Scripted(), Scripted('aborted', 'aborted', 'ok'))
    assert machine.run() == 'done'
    assert noted(machine, 'B') == [('again', FIRST, False), ('wait 10 s', LATER, True)]


def test_the_next_success_takes_no_short_way_past_the_log():
    machine = machine_of(Scripted(), Scripted('ok', 'ok', 'ok', 'aborted', 'ok', 'ok'))
    for _ in range(5):
        assert machine.run() == 'done'
    assert noted(machine, 'B') == [('again', FIRST, True)]


def test_failures_of_other_states_meanwhile_say_nothing_of_it():
    machine = machine_of(
        Scripted(), Scripted('ok', 'aborted'), Scripted('aborted', 'aborted', 'aborted')
    )
    assert machine.run() == 'done'
    # C went back over B, which failed itself on the way and was entered again
    assert noted(machine, 'B') == [('again', FIRST, True)]
    assert noted(machine, 'C')[-1] == ('from A', LATER, True)


def test_nothing_is_known_where_a_person_has_acted_meanwhile():
    expert = FakeExpert(supersede('ok'))
    states = Scripted(), Scripted('ok', *['aborted'] * 9), Scripted('aborted', 'ok')
    machine = machine_of(*states, expert=expert)
    assert machine.run() == 'done'
    assert noted(machine, 'C') == [('again', FIRST, True)]
    assert [helped for _, _, helped in noted(machine, 'B')] == []


def test_a_way_back_over_a_state_that_a_person_has_superseded_is_not_known():
    expert = FakeExpert(supersede('ok'))
    b = Scripted('ok', *['aborted'] * 9)
    machine = machine_of(Scripted(), b, Scripted(*['aborted'] * 3), expert=expert)
    assert machine.run() == 'done'
    assert noted(machine, 'C')[-1] == ('from A', LATER, None)


def test_the_choice_of_a_person_is_noted_as_such():
    expert = FakeExpert(goto('A'))
    machine = machine_of(
        Scripted(), Scripted(*['aborted'] * 4), expert=expert, cost={'lost_trial': 60}
    )
    assert machine.run() == 'done'
    assert noted(machine, 'B')[-1] == ('from A', BY_PERSON, True)


def failing_at_a(end):
    """B fails for good. Going back to A then ends as told, in the machine's outcome `failed`."""
    a = Scripted('ok', end, outcomes=('ok', 'stop'))
    machine = smach.StateMachine(outcomes=[*ENDS, 'failed'])
    with machine:
        smach.StateMachine.add('A', a, {'ok': 'B', 'stop': 'failed'})
        smach.StateMachine.add(
            'B', Scripted(*['aborted'] * 3), {'ok': 'done', 'aborted': 'aborted'}
        )
    watch = Watched(
        machine,
        settings={'policy': 'escalating', 'intended_outcomes': ['stop'], 'max_recoveries': 50},
    )
    oracle_of(watch.machine).waiting = FakeWaiting()
    return watch


def test_a_trial_that_is_lost_first_says_that_the_way_has_not_helped():
    watch = failing_at_a('stop')
    assert watch.run() == 'failed'
    assert noted(watch, 'B')[-1] == ('from A', LATER, False)


def test_a_trial_that_is_preempted_says_nothing_of_its_last_way():
    def stopped(state, ud):
        watch.machine.request_preempt()
        return 'stop'

    watch = failing_at_a(stopped)
    assert watch.run() == 'failed'
    assert noted(watch, 'B')[-1] == ('from A', LATER, None)


def test_a_lost_trial_says_that_the_choice_of_a_person_has_not_helped():
    a = Scripted('ok', 'stop', outcomes=('ok', 'stop'))
    machine = smach.StateMachine(outcomes=[*ENDS, 'failed'])
    with machine:
        smach.StateMachine.add('A', a, {'ok': 'B', 'stop': 'failed'})
        smach.StateMachine.add('B', Scripted('aborted'), {'ok': 'done'})
    watch = Watched(
        machine,
        settings={'policy': 'escalating', 'intended_outcomes': ['stop'], 'max_recoveries': 0},
        expert=FakeExpert(goto('A')),
    )
    assert watch.run() == 'failed'
    assert noted(watch, 'B') == [('from A', BY_PERSON, False)]


def test_a_trial_that_a_person_gives_up_says_nothing_of_the_last_way():
    expert = FakeExpert(give_up())
    machine = machine_of(Scripted(), Scripted(*['aborted'] * 9), expert=expert)
    assert machine.run() == 'aborted'
    assert [helped for _, _, helped in noted(machine, 'B')] == [False] * 3


def test_a_choice_in_another_container_is_noted_for_the_state_that_failed():
    inner = smach.StateMachine(outcomes=ENDS)
    with inner:
        smach.StateMachine.add('S', Scripted('aborted'), {'ok': 'done'})
    top = smach.StateMachine(outcomes=ENDS)
    with top:
        smach.StateMachine.add('A', Scripted(), {'ok': 'M'})
        smach.StateMachine.add('M', inner, {'done': 'done'})
    watch = Watched(
        top,
        settings={'policy': 'escalating', 'max_recoveries': 0, 'escalate': False},
        expert=FakeExpert(goto('A', container='SM_ROOT')),
    )
    assert watch.run() == 'done'
    (result,) = marked_node(inner).record('S').ways_so_far()
    assert (result.way, result.place, result.helped) == ('from /A', BY_PERSON, True)
    assert noted(watch, 'M') == []


def test_a_person_without_a_name_is_a_person():
    expert = FakeExpert(supersede('ok')._replace(by=''))
    b = Scripted('ok', *['aborted'] * 9)
    machine = machine_of(Scripted(), b, Scripted(*['aborted'] * 3), expert=expert)
    assert machine.run() == 'done'
    assert noted(machine, 'C')[-1] == ('from A', LATER, None)


def test_a_failure_that_another_state_reports_goes_by_its_own_text():
    work = Scripted('failed', outcomes=('ok', 'failed'))
    machine = smach.StateMachine(outcomes=ENDS)
    with machine:
        smach.StateMachine.add('WORK', work, {'ok': 'done', 'failed': 'TIDY'})
        smach.StateMachine.add('TIDY', Scripted(outcomes=('ok',)), {'ok': 'aborted'})
    watch = Watched(machine, settings={'policy': 'escalating', 'max_recoveries': 50})
    oracle_of(watch.machine).waiting = FakeWaiting()
    oracle_of(watch.machine).describe_failure = lambda state: 'the arm blocks the view'
    assert watch.run() == 'done'
    (result,) = marked_node(watch.machine).record('WORK').ways_so_far()
    assert result.failure == 'failing_outcome failed: the arm blocks the view'


def test_an_operator_who_sends_the_machine_on_says_nothing_of_a_way():
    machine = machine_of(Scripted(), Scripted('aborted'))
    record = marked_node(machine.machine).record('B')
    record.go_way(a_result(), float)
    settle_ways(marked_node(machine.machine), None)
    assert noted(machine, 'B') == [('again', FIRST, None)]


def test_a_new_trial_says_nothing_of_the_way_of_the_last_one():
    record = StateRecord('A', StateSettings())
    record.go_way(a_result(), float)
    record.begin_trial()
    assert [each.helped for each in record.ways_so_far()] == [None]


def test_a_copy_has_the_results_and_not_the_way_under_way():
    record = StateRecord('A', StateSettings())
    record.go_way(a_result(), float)
    record.settle_way(True)
    record.go_way(a_result(), float)
    twin = copy.deepcopy(record)
    twin.settle_way(True)
    assert len(twin.ways_so_far()) == 1


def test_an_error_that_ends_the_trial_says_that_the_way_has_not_helped():
    def broken(state, ud):
        raise ValueError('broken')

    a, b = Scripted('ok', broken), Scripted(*[ValueError('broken, too')] * 9)
    machine = machine_of(a, b, budget={'recoveries': 3})
    with pytest.raises(smach.InvalidUserCodeError):
        machine.run()
    assert noted(machine, 'B')[-1] == ('from A', LATER, False)


def test_other_policies_note_nothing():
    machine = machine_of(Scripted(), Scripted('aborted'), policy='prose')
    assert machine.run() == 'done'
    assert noted(machine, 'B') == []
    assert 'ways' not in marked_node(machine.machine).record('B').learned()


# -- kept


def test_machines_that_share_a_rates_file_share_the_results(tmp_path):
    settings = {'rates_file': str(tmp_path / 'rates.json')}
    one, other = (machine_of(Scripted(), Scripted('aborted'), **settings) for _ in range(2))
    assert one.run() == 'done' and other.run() == 'done'
    assert len(noted(other, 'B')) == 2
    told = json.loads((tmp_path / 'rates.json').read_text())['containers']['']['B']
    assert told['ways_total'] == 2 and len(told['ways']['results']) == 2


@pytest.mark.parametrize(
    'damage',
    [
        7,
        {'names': [['again', 'again']], 'failures': [], 'results': ['0 0 0 1 1.0']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 9 0 1 1.0']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 0 0 yes 1.0']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 0 0 1 nan']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 0 0 1 -5']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['-1 0 0 1 1.0']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 0 0 1 1.0 nan']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 0 0 1 1.0 -0.1']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 0 0 1 1.0 1.1']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': ['0 0 0 1 inf']},
        {'names': [['again', 'again']], 'failures': ['x'], 'results': [[0, 0, 0, True, 1.0]]},
    ],
)
def test_damaged_results_leave_the_state_with_its_prior_and_are_warned_of(tmp_path, damage):
    path = tmp_path / 'rates.json'
    machine = machine_of(Scripted(), Scripted('aborted'), rates_file=str(path))
    assert machine.run() == 'done'
    content = json.loads(path.read_text())
    content['containers']['']['B']['ways'] = damage
    path.write_text(json.dumps(content))
    warned = []
    smach.set_loggers(lambda text: None, warned.append, lambda text: None, lambda text: None)
    again = machine_of(Scripted(), Scripted('aborted'), rates_file=str(path))
    assert again.run() == 'done'
    assert any("'B' of" in text and 'results of ways' in text for text in warned)


def test_a_number_of_results_without_end_is_damage(tmp_path):
    path = tmp_path / 'rates.json'
    machine = machine_of(Scripted(), Scripted('aborted'), rates_file=str(path))
    assert machine.run() == 'done'
    text = path.read_text()
    assert '"ways_total": 1' in text
    path.write_text(text.replace('"ways_total": 1', '"ways_total": Infinity'))
    again = machine_of(Scripted(), Scripted('aborted'), rates_file=str(path))
    assert again.run() == 'done'


def a_result(number=0, failure='failing_outcome aborted', **more):
    return WayResult('again', 'again', FIRST, failure, None, 0.0)._replace(**more)


def filled(count, log=None):
    log = log or WayLog()
    for number in range(count):
        log.go(a_result(), lambda number=number: float(number))
        log.settle(True)
    return log


def test_a_result_is_read_as_it_was_told():
    told = [a_result(hoped=hoped, minutes=0.5) for hoped in (None, 0.0, 0.25, 1.0)]
    assert results_in(told_of(told, 7)) == (told, 7)


def test_the_latest_results_are_kept():
    log = filled(MOST_RESULTS + 7)
    assert len(log.results) == MOST_RESULTS and log.total == MOST_RESULTS + 7
    assert log.results[-1].minutes == MOST_RESULTS + 6
    again = WayLog()
    again.take_over(json.loads(json.dumps(log.told())))
    assert again.results == log.results and again.total == log.total


def test_what_is_new_since_the_last_share_comes_behind_the_others():
    own, theirs = filled(5), filled(3)
    base = {'ways_total': 4}
    merged = merged_ways(own.told(), base, theirs.told())
    assert merged['ways_total'] == 4
    assert [row.split()[4] for row in merged['ways']['results']] == ['0', '1', '2', '4']


def test_where_nothing_is_new_here_or_there_the_results_stay_as_they_are():
    own = filled(MOST_RESULTS + 3).told()
    theirs = json.loads(json.dumps(own))
    assert merged_ways(own, {'ways_total': own['ways_total']}, theirs) == own
    filled_up = filled(MOST_RESULTS + 4).told()
    assert merged_ways(own, {'ways_total': own['ways_total']}, filled_up) == filled_up
    base = {'ways_total': own['ways_total'] - 1}  # by chance others have learned the same
    assert merged_ways(own, base, theirs)['ways_total'] == own['ways_total'] + 1


def test_results_that_a_program_of_an_earlier_version_has_dropped_stay():
    own = filled(5)
    assert merged_ways(own.told(), {'ways_total': 5}, {'successes': 3}) == own.told()


def test_where_nobody_has_results_none_are_told():
    emptied = {'ways': {'names': [], 'failures': [], 'results': []}, 'ways_total': 3}
    assert merged_ways({}, {}, emptied) == {}


def test_a_state_has_so_many_kinds_of_failure_with_a_text():
    log = WayLog()
    for number in range(MOST_FAILURES + 3):
        key = log.failure_key(1, 'aborted', 'part ' + 'abcdefghijklm'[number])
        log.go(a_result(failure=key), float)
        log.settle(None)
    kinds = {each.failure for each in log.results}
    assert len(kinds) == MOST_FAILURES + 1
    assert plain_failure_key('failing_outcome aborted: part a') in kinds
    assert log.failure_key(1, 'aborted', 'part a') == 'failing_outcome aborted: part a'


def counted_from_nothing(results):
    counts = {}
    for each in results:
        if each.helped is not None:
            helped, not_helped = counts.get((each.kind, each.place), (0.0, 0.0))
            counts[each.kind, each.place] = helped + each.helped, not_helped + (not each.helped)
    return counts


@pytest.mark.parametrize('seed', range(20))
def test_a_log_counts_as_one_does_who_looks_at_all_its_results(seed):
    rng = random.Random(seed)
    logs = [WayLog(), WayLog()]
    for _ in range(3 * MOST_RESULTS):
        number = rng.randrange(2)
        log = logs[number]
        failure = rng.choice(['failing_outcome aborted', 'failing_outcome aborted: '])
        text = chr(ord('a') + rng.randrange(12)) if failure.endswith(' ') else ''
        way = a_result(0, failure + text, kind=rng.choice('xyz'), place=rng.randrange(3))
        log.go(way, float)
        log.settle(rng.choice([True, False, None]))
        if rng.random() < 0.05:
            logs[number] = log = log.twin()
        elif rng.random() < 0.05:
            log.take_over(copy.deepcopy(log.told()))
        assert log.of_kinds == counted_from_nothing(log.results)
        known = {each.failure for each in log.results if ':' in each.failure}
        for text in 'abcdefghijkl':
            key = 'failing_outcome aborted: ' + text
            is_known = key in known or len(known) < MOST_FAILURES
            assert log.failure_key(1, 'aborted', text) == (
                key if is_known else 'failing_outcome aborted'
            )
    both = [each for log in logs for each in log.results]
    assert counts_of_kinds(log.of_kinds for log in logs) == counted_from_nothing(both)


def test_records_of_earlier_versions_are_read():
    record = StateRecord('A', StateSettings())
    record.restore({'estimator': 'window', 'successes': 2, 'failures': 1, 'window': [1, 0, 0]})
    assert record.ways_so_far() == () and 'ways' not in record.learned()


def test_a_record_goes_on_behind_what_a_stored_trial_has_counted():
    record = StateRecord('A', StateSettings())
    edge = FastEdge('B', 'B', 'A:ok-->B', Visit('A', 'ok', VisitResult.SUCCESS))
    record.fast['ok'] = edge
    record.visit_ended()
    edge.count = 2
    record.go_on([7, 1, 2, 3], 0.5)
    assert (record.visits, record.longest_s) == (7, 0.5)
    assert (record.recoveries, record.fallbacks, record.unwell_repeats) == (1, 2, 3)
    record.visit_ended()
    assert record.visits == 8


def test_a_jump_says_by_which_way_of_the_menu_it_goes():
    machine = machine_of(Scripted('aborted'))
    assert machine.run() == 'done'
    assert [event.data['way'] for event in machine.of(EventKind.JUMP)] == ['again']
