"""A state that raises as it is tried again ends its container as its earlier failure would have."""

import pytest
from guarded_machines import chain
from machines import FakeExpert, Scripted, Watched, goto, supersede

import smach
from smach_oracle.oracle.records.events import EventKind, FailureKind

ONCE = {'max_recoveries': 1}
ERROR = IndexError('pop from empty list')


def ended(machine):
    (event,) = machine.of(EventKind.GIVE_UP)
    return event.outcome, event.target


@pytest.mark.parametrize('raised', [ERROR, 'odd', None])
def test_it_ends_by_the_outcome_of_the_first_failure(raised):
    pick = Scripted('aborted', lambda state, ud: _raise_or_return(raised))
    machine = Watched(chain(LOOK=Scripted(), PICK=pick), settings=ONCE)
    assert machine.run() == 'aborted' and pick.runs == 2
    assert ended(machine) == ('aborted', '')


def _raise_or_return(what):
    if isinstance(what, Exception):
        raise what
    return what


def test_the_failure_that_is_told_is_that_of_the_exception():
    machine = Watched(chain(PICK=Scripted('aborted', ERROR)), settings=ONCE)
    machine.run()
    failures = machine.of(EventKind.FAILURE)
    assert [FailureKind(each.failure_kind) for each in failures] == [
        FailureKind.FELL_THROUGH,
        FailureKind.EXCEPTION,
    ]
    assert failures[1].text == 'IndexError: pop from empty list'


def test_what_the_author_drew_above_is_next_and_nobody_is_asked():
    expert, tidy = FakeExpert(), Scripted()
    top = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with top:
        inner = chain(PICK=Scripted('aborted', ERROR))
        smach.StateMachine.add('PICK_ALL', inner, {'aborted': 'TIDY_UP'})
        smach.StateMachine.add('TIDY_UP', tidy, {'ok': 'done'})
    machine = Watched(top, expert=expert, settings=ONCE)
    assert machine.run() == 'done'
    assert tidy.runs == 1 and not expert.questions


def test_another_state_on_the_way_back_may_raise():
    machine = chain(LOOK=Scripted('ok', ERROR, ERROR), PICK=Scripted('aborted'))
    settings = {'policy': 'step_back', 'max_recoveries': 1}
    assert Watched(machine, settings=settings).run() == 'aborted'


def test_once_the_state_has_succeeded_an_exception_is_one_again():
    machine = Watched(
        chain(PICK=Scripted('aborted', 'ok'), PLACE=Scripted(ERROR, ERROR)), settings=ONCE
    )
    with pytest.raises(smach.InvalidUserCodeError, match='pop from empty list'):
        machine.run()


def test_once_an_expert_has_done_its_work_an_exception_is_one_again():
    machine = Watched(
        chain(PICK=Scripted('aborted'), PLACE=Scripted(ERROR)),
        expert=FakeExpert(supersede('ok')),
        settings={'max_recoveries': 0},
    )
    with pytest.raises(smach.InvalidUserCodeError, match='pop from empty list'):
        machine.run()


def test_an_exception_that_came_first_stays_one():
    machine = Watched(chain(PICK=Scripted(ERROR, ERROR)), settings=ONCE)
    with pytest.raises(smach.InvalidUserCodeError, match='pop from empty list'):
        machine.run()


def test_a_failure_that_its_author_has_foreseen_ends_nothing():
    machine = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with machine:
        smach.StateMachine.add('PICK', Scripted('aborted'), {'aborted': 'LOOK', 'ok': 'done'})
        smach.StateMachine.add('LOOK', Scripted(ERROR, ERROR), {'ok': 'PICK'})
    with pytest.raises(smach.InvalidUserCodeError, match='pop from empty list'):
        Watched(machine, settings=ONCE).run()


def test_a_failure_of_an_earlier_execution_ends_nothing():
    inner = chain(PICK=Scripted('aborted', ERROR))
    top = smach.StateMachine(outcomes=['done', 'aborted', 'preempted'])
    with top:
        smach.StateMachine.add('PICK_ALL', inner, {'aborted': 'LOOK'})
        smach.StateMachine.add('LOOK', Scripted(), {'ok': 'PICK_ALL'})
    machine = Watched(top, settings={'max_recoveries': 0})
    with pytest.raises(smach.InvalidUserCodeError, match='pop from empty list'):
        machine.run()


def iterator_of(state, loop_outcomes):
    iterator = smach.Iterator(
        ['done', 'aborted', 'preempted'], [], [], ['cup', 'can'], 'item', 'done'
    )
    with iterator:
        smach.Iterator.set_contained_state('PICK', state, loop_outcomes=loop_outcomes)
    return iterator


def test_an_item_ends_as_it_would_have():
    pick = Scripted('aborted', ERROR)
    assert Watched(chain(ALL=iterator_of(pick, ['ok'])), settings=ONCE).run() == 'aborted'
    assert pick.runs == 2


def test_the_end_of_one_item_is_not_that_of_the_next():
    pick = Scripted('aborted', ERROR, ERROR)
    settings = {'max_recoveries': 0, 'author_recoveries': 'override'}
    machine = Watched(chain(ALL=iterator_of(pick, ['ok', 'aborted'])), settings=settings)
    with pytest.raises(smach.InvalidUserCodeError, match='pop from empty list'):
        machine.run()
    assert pick.runs == 2


def test_an_answer_leads_on_as_from_any_failure():
    expert = FakeExpert(goto('PICK'))
    pick = Scripted('aborted', ERROR)
    machine = Watched(chain(PICK=pick), expert=expert, settings=ONCE)
    assert machine.run() == 'done' and pick.runs == 3
    (question,) = expert.questions
    assert question.fallback == 'stop with aborted'
