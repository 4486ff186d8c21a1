"""Concurrences of plain states: a branch that fails recovers inside itself, the others go on."""

import os
import threading

import pytest
from branch_machines import both, inside
from machines import (
    FakeExpert,
    Gate,
    Scripted,
    Watched,
    chain_of,
    give_up,
    goto,
    in_thread,
    supersede,
)

import smach
from smach_oracle.oracle.records.events import EventKind

ASKS = {'max_recoveries': 0}


def watched(concurrence, **wrap):
    return Watched(inside(concurrence), name='TOP', **wrap)


def waiting_for(event):
    """A step of a state that waits until something has happened."""

    def step(state, ud):
        assert event.wait(20)
        return 'ok'

    return step


def test_a_branch_that_fails_is_done_again_and_no_other_one():
    left, right = Scripted('aborted', ValueError('slipped')), Scripted()
    machine = watched(both(left, right))
    assert machine.run() == 'done'
    assert (left.runs, right.runs) == (3, 1)
    assert {(event.path, event.state) for event in machine.of(EventKind.FAILURE)} == {
        ('TOP/ALL', 'LEFT')
    }
    assert (machine.rate('LEFT').failures, machine.rate('RIGHT').failures) == (2, 0)


def test_the_others_go_on_while_a_branch_asks():
    went_on = threading.Event()

    def waits_for_the_other(question, cancelled, progress):
        assert went_on.wait(20), 'RIGHT stood still'
        return goto('LEFT')

    asked = threading.Event()

    def right(state, ud):
        assert asked.wait(20)
        went_on.set()
        return 'ok'

    class Expert(FakeExpert):
        def ask(self, *args):
            asked.set()
            return super().ask(*args)

    expert = Expert(waits_for_the_other)
    left = Scripted('aborted')
    machine = watched(both(left, Scripted(right)), expert=expert, settings=ASKS)
    assert machine.run() == 'done'
    assert left.runs == 2
    (question,) = expert.questions
    assert (question.container_path, question.failed_state) == ('TOP/ALL', 'LEFT')
    assert dict(question.supersede_outcomes)['ok'] == 'the end of this branch'


@pytest.mark.parametrize('answer', [supersede('ok'), give_up('ok')])
def test_what_an_expert_decides_is_the_outcome_of_the_branch_in_map_and_callback(answer):
    told = []
    left, right = Scripted('aborted'), Scripted()
    machine = watched(
        both(left, right, child_termination_cb=lambda ended: told.append(dict(ended)) and False),
        expert=FakeExpert(answer),
        settings=ASKS,
    )
    assert machine.run() == 'done'
    assert told[-1] == {'LEFT': 'ok', 'RIGHT': 'ok'}
    assert left.runs == 1


def test_a_branch_that_gives_up_ends_the_concurrence_as_its_author_has_mapped_it():
    machine = watched(
        both(Scripted('aborted'), Scripted()),
        settings=ASKS,
        expert=FakeExpert(give_up(), give_up()),
    )
    assert machine.run() == 'aborted'


@pytest.mark.parametrize('good', [True, False])
def test_an_outcome_that_the_map_leads_to_a_good_end_is_the_authors(good):
    left = Scripted('aborted')
    mapped = {'done' if good else 'aborted': {'LEFT': 'aborted'}}
    machine = watched(
        both(left, Scripted(), outcome_map=mapped, default_outcome='done'),
        settings={'max_recoveries': 1},
    )
    assert machine.run() == 'done'
    assert left.runs == (1 if good else 2)
    assert len(machine.of(EventKind.DECISION)) == (0 if good else 1)
    assert machine.rate('LEFT').failures == 1, 'it has failed either way'


def test_a_callback_that_ends_the_others_ends_one_that_is_asked_about():
    asked = threading.Event()

    def waits(question, cancelled, progress):
        asked.set()
        assert cancelled.wait(20)

    machine = watched(
        both(
            Scripted('aborted'),
            Scripted(waiting_for(asked)),
            default_outcome='done',
            outcome_map={},
            child_termination_cb=lambda ended: ended['RIGHT'] == 'ok',
        ),
        expert=FakeExpert(waits),
        settings=ASKS,
    )
    assert machine.run() == 'done'
    assert machine.of(EventKind.QUERY_CANCELLED)


def test_a_preempt_of_the_machine_ends_a_branch_that_is_asked_about_and_one_that_runs():
    asked, gate = threading.Event(), Gate()

    def waits(question, cancelled, progress):
        asked.set()
        assert cancelled.wait(20)

    left, right = Scripted('aborted'), Scripted(gate)
    machine = watched(
        both(left, right, outcome_map={'preempted': {'LEFT': 'preempted', 'RIGHT': 'preempted'}}),
        expert=FakeExpert(waits),
        settings=ASKS,
    )
    call = in_thread(machine.run)
    assert asked.wait(20) and gate.entered.wait(20)
    machine.machine.request_preempt()
    assert call.result() == 'preempted'
    assert not left.preempt_requested() and not right.preempt_requested()
    machine.machine.userdata.done = []
    assert machine.run() == 'aborted', 'no map entry for two good ends; no request is left behind'


class Writer(smach.State):
    def __init__(self, wrote, read):
        smach.State.__init__(self, ['ok', 'aborted'], output_keys=['beat'])
        self._wrote, self._read = wrote, read

    def execute(self, ud):
        ud.beat = 'first'
        self._wrote.set()
        assert self._read.wait(20)
        return 'ok'


def test_what_a_branch_writes_is_seen_by_one_that_runs_and_by_a_recovery():
    wrote, read = threading.Event(), threading.Event()
    seen = []

    class Reader(smach.State):
        def __init__(self):
            smach.State.__init__(self, ['ok', 'aborted'], input_keys=['beat'], output_keys=['mine'])

        def execute(self, ud):
            assert wrote.wait(20)
            seen.append(ud.beat)
            ud.mine = len(seen)
            if len(seen) == 1:
                return 'aborted'
            read.set()
            return 'ok'

    concurrence = both(Reader(), Writer(wrote, read))
    concurrence.userdata.beat = 'none'
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert seen == ['first', 'first'], 'the retry does not take back what the other wrote'
    assert concurrence.userdata.mine == 2


def test_a_precondition_that_is_not_met_takes_back_its_own_writes_alone():
    wrote = threading.Event()

    def fails(ud):
        ud.mine = 'half'
        wrote.set()
        assert other.wait(20)
        return False

    other = threading.Event()

    class Right(smach.State):
        def __init__(self):
            smach.State.__init__(self, ['ok', 'aborted'], output_keys=['beat'])

        def execute(self, ud):
            assert wrote.wait(20)
            ud.beat = 'written'
            other.set()
            return 'ok'

    concurrence = both(Scripted('aborted'), Right())
    machine = watched(concurrence, preconditions={'ALL/LEFT': [fails]})
    machine.run()
    assert concurrence.userdata.beat == 'written'
    assert 'mine' not in concurrence.userdata


def test_what_a_precondition_that_was_met_wrote_stays_where_the_next_one_is_not_met():
    def met(ud):
        ud.mine = 'met'
        return True

    def fails(ud):
        ud.mine = 'half'
        return False

    concurrence = both(Scripted('aborted'), Scripted())
    machine = watched(concurrence, preconditions={'ALL/LEFT': [met, fails]})
    machine.run()
    assert concurrence.userdata.mine == 'met'


def test_a_jump_misses_what_a_precondition_that_is_not_met_has_written():
    def fails(ud):
        ud.mine = 'half'
        return False

    concurrence = both(Scripted('aborted', input_keys=['mine']), Scripted())
    machine = watched(concurrence, preconditions={'ALL/LEFT': [fails]})
    machine.run()
    assert machine.of(EventKind.JUMP)[0].data['missing_keys'] == ['mine']


def test_an_expert_names_the_branch_beside_by_its_path():
    expert = FakeExpert(goto('RIGHT', container='TOP/ALL'))
    left, right = Scripted('aborted'), Scripted()
    machine = watched(both(left, right), expert=expert, settings=ASKS)
    assert machine.run() == 'done'
    assert len(expert.questions) == 1 and (left.runs, right.runs) == (2, 2), 'all run again'


def test_remappings_of_branches_hold():
    class Adds(smach.State):
        def __init__(self):
            smach.State.__init__(self, ['ok', 'aborted'], io_keys=['count'])
            self.script = ['aborted']

        def execute(self, ud):
            ud.count = ud.count + 1
            return self.script.pop() if self.script else 'ok'

    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        input_keys=[],
        output_keys=[],
        outcome_map={'done': {'ONE': 'ok', 'TWO': 'ok'}},
    )
    concurrence.userdata.a, concurrence.userdata.b = 0, 10
    with concurrence:
        smach.Concurrence.add('ONE', Adds(), remapping={'count': 'a'})
        smach.Concurrence.add('TWO', Adds(), remapping={'count': 'b'})
    machine = watched(concurrence)
    assert machine.run() == 'done'
    assert (concurrence.userdata.a, concurrence.userdata.b) == (2, 12)


def test_one_state_in_two_branches_and_in_the_machine_itself():
    shared = Scripted('aborted', 'ok')
    machine = inside(both(shared, shared), transitions={'done': 'SAME'})
    with machine:
        smach.StateMachine.add('SAME', shared, {'ok': 'done'})
    machine = Watched(machine, name='TOP')
    assert machine.run() == 'done'
    assert shared.runs == 4
    (failure,) = machine.of(EventKind.FAILURE)
    assert failure.path == 'TOP/ALL' and failure.state in ('LEFT', 'RIGHT')


def test_an_iterator_in_a_concurrence_recovers_its_items():
    iterator = smach.Iterator(
        outcomes=['ok', 'aborted'],
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='item',
        exhausted_outcome='ok',
    )
    each = Scripted('ok', 'aborted')
    with iterator:
        smach.Iterator.set_contained_state('EACH', each, loop_outcomes=['ok'])
    machine = watched(both(iterator, Scripted('aborted')))
    assert machine.run() == 'done'
    assert {(event.path, event.state) for event in machine.of(EventKind.FAILURE)} == {
        ('TOP/ALL/LEFT', 'EACH'),
        ('TOP/ALL', 'RIGHT'),
    }
    assert each.runs == 3


def both_again(expert):
    """Run two branches, then a state that fails, from which the expert goes to them again."""
    left, right = Scripted(), Scripted()
    machine = inside(both(left, right), transitions={'done': 'AFTER'})
    with machine:
        smach.StateMachine.add('AFTER', Scripted('aborted'), {'ok': 'done'})
    machine = Watched(machine, expert=expert, settings=ASKS)
    assert machine.run() == 'done'
    assert (left.runs, right.runs) == (2, 2)
    return {choice.state: choice.runs_again for choice in expert.questions[0].choices}


def test_the_question_above_says_which_branches_run_again():
    again = both_again(FakeExpert(goto('ALL')))
    assert again['ALL'] == ('LEFT', 'RIGHT')
    assert again['AFTER'] == ()


def test_the_question_says_what_runs_again_if_a_single_branch_is_gone_to():
    again = both_again(FakeExpert(goto('LEFT', container='SM_ROOT/ALL')))
    assert again['LEFT'] == ('LEFT', 'RIGHT')


def test_the_question_says_so_of_a_concurrence_in_an_iterator():
    expert = FakeExpert(give_up())
    iterator = smach.Iterator(
        outcomes=['done', 'aborted'],
        input_keys=[],
        output_keys=[],
        it=[1],
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state(
            'BOTH', both(Scripted(), Scripted()), loop_outcomes=['done']
        )
    machine = inside(iterator, transitions={'done': 'AFTER'})
    with machine:
        smach.StateMachine.add('AFTER', Scripted('aborted'), {'ok': 'done'})
    Watched(machine, expert=expert, settings=ASKS).run()
    choices = {choice.state: choice for choice in expert.questions[0].choices}
    assert choices['RIGHT'].runs_again == ('LEFT', 'RIGHT')
    assert choices['AFTER'].runs_again == ()


def test_a_branch_that_is_tried_again_by_itself_says_of_no_other_that_it_runs_again():
    expert = FakeExpert(give_up())
    Watched(inside(both(Scripted('aborted'), Scripted())), expert=expert, settings=ASKS).run()
    choices = {choice.state: choice for choice in expert.questions[0].choices}
    assert choices['LEFT'].runs_again == ()


@pytest.mark.filterwarnings('ignore::pytest.PytestUnhandledThreadExceptionWarning')
def test_an_error_of_a_branch_that_gives_up_is_that_of_the_bare_concurrence():
    bare = inside(both(Scripted(KeyError('lost')), Scripted()))
    with pytest.raises(smach.InvalidUserCodeError, match='InvalidStateError'):
        bare.execute()
    machine = watched(
        both(Scripted(KeyError('lost')), Scripted()),
        settings=ASKS,
        expert=FakeExpert(give_up(), give_up()),
    )
    with pytest.raises(smach.InvalidUserCodeError, match='InvalidStateError'):
        machine.run()


def test_an_outcome_that_is_not_registered_is_a_failure_and_given_up_is_as_bare():
    left = Scripted('odd')
    machine = watched(
        both(left, Scripted(), default_outcome='done', outcome_map={}),
        settings=ASKS,
        expert=FakeExpert(give_up()),
    )
    assert machine.run() == 'done'
    assert machine.of(EventKind.FAILURE)[0].state == 'LEFT'
    again = Scripted('odd')
    machine = watched(both(again, Scripted()))
    assert machine.run() == 'done'
    assert again.runs == 2


def test_an_overrun_of_a_branch_is_recovered_inside_it():
    gate = Gate()
    left = Scripted(gate)
    machine = watched(
        both(left, Scripted()),
        settings={'states': {'ALL/LEFT': {'time_limit_s': 0.2, 'grace_period_s': 5.0}}},
    )
    assert machine.run() == 'done'
    assert left.runs == 2


def test_each_branch_has_a_chain_of_its_own_and_many_fail_at_once():
    states = {'S{}'.format(index): Scripted(*['aborted', 'ok'] * 10) for index in range(6)}
    concurrence = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': dict.fromkeys(states, 'ok')},
    )
    with concurrence:
        for label, state in states.items():
            smach.Concurrence.add(label, state)
    machine = watched(concurrence)
    for _ in range(10):
        assert machine.run() == 'done'
    by_trial = {}
    for event in machine.events:
        by_trial.setdefault(event.trial_id, []).append(event.seq)
    assert all(seqs == list(range(len(seqs))) for seqs in by_trial.values())
    assert not any(event.continuous for event in machine.of(EventKind.FAILURE))
    assert {
        (row.state, row.failures, row.successes)
        for row in machine.machine.rates()
        if row.path == 'TOP/ALL'
    } == {(label, 10, 10) for label in states}


def test_a_machine_beside_a_plain_branch_is_wrapped_and_both_recover():
    inner = chain_of(Scripted('aborted'), outcomes=('ok', 'done', 'aborted', 'preempted'))
    machine = watched(
        both(inner, Scripted('aborted'), outcome_map={'done': {'LEFT': 'done', 'RIGHT': 'ok'}})
    )
    assert machine.run() == 'done'
    assert {event.path for event in machine.of(EventKind.FAILURE)} == {'TOP/ALL/LEFT', 'TOP/ALL'}


@pytest.mark.skipif(
    bool(os.environ.get('SMACH_UPSTREAM')), reason="upstream's Concurrence wants a mapping"
)
@pytest.mark.parametrize('conditions', [(), []])
def test_an_entry_of_an_outcome_map_that_is_empty_foresees_nothing(conditions):
    left = Scripted('aborted')
    outcome_map = {'found': conditions, 'done': {'LEFT': 'ok', 'RIGHT': 'ok'}}
    concurrence = both(
        left, Scripted(), outcomes=['done', 'found', 'aborted'], outcome_map=outcome_map
    )
    machine = Watched(inside(concurrence, transitions={'done': 'done', 'found': 'done'}))
    assert machine.run() == 'done' and left.runs == 2
    assert [event.state for event in machine.of(EventKind.DECISION)] == ['LEFT']
