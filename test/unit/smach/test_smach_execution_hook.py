"""The hook that a Concurrence and an Iterator of our engine ask while they execute."""

import copy

import pytest

import smach

hooks = pytest.importorskip('smach.hooks', reason='of our engine alone')
OUTCOMES = ['ok', 'aborted', 'preempted']


class Fixed(smach.State):
    def __init__(self, outcome='ok'):
        smach.State.__init__(self, OUTCOMES)
        self.outcome, self.runs = outcome, 0

    def execute(self, ud):
        self.runs += 1
        return self.outcome


class Runner:
    """Executes in place of a state, and notes its preempt requests."""

    def __init__(self, outcome='aborted', when=lambda: None):
        self.outcome, self.when, self.asked = outcome, when, False

    def execute(self, ud):
        self.when()
        return self.outcome

    def request_preempt(self):
        self.asked = True

    def preempt_requested(self):
        return self.asked

    def recall_preempt(self):
        self.asked = False


def iterator(state, items=(1, 2)):
    made = smach.Iterator(OUTCOMES, [], [], it=items, it_label='item', exhausted_outcome='ok')
    with made:
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=['ok'])
    return made


def concurrence(state):
    made = smach.Concurrence(OUTCOMES, 'ok', outcome_map={'aborted': {'EACH': 'aborted'}})
    with made:
        smach.Concurrence.add('EACH', state)
    return made


@pytest.fixture(params=[iterator, concurrence], ids=['iterator', 'concurrence'])
def make(request):
    return request.param


def test_a_plain_hook_changes_nothing(make):
    state = Fixed()
    container = make(state)
    container.execution_hook = hooks.ExecutionHook()
    assert container.execute() == 'ok' and state.runs


def test_a_runner_executes_in_place_of_the_state_which_stays_the_child(make):
    state = Fixed()
    container = make(state)
    container.execution_hook = hook = hooks.ExecutionHook()
    seen = []
    hook.runners['EACH'] = Runner(
        when=lambda: seen.append((container.get_children()['EACH'], container['EACH']))
    )
    assert container.execute() == 'aborted'
    assert state.runs == 0 and seen == [(state, state)]


def test_a_preempt_request_goes_to_the_runner_and_is_recalled_there(make):
    state = Fixed()
    container = make(state)
    container.execution_hook = hook = hooks.ExecutionHook()
    asked = []

    def when():
        container.request_preempt()
        asked.append(runner.asked)

    runner = hook.runners['EACH'] = Runner('ok', when)
    container.execute()
    assert asked == [True] and not runner.asked and not state.preempt_requested()


def test_it_is_told_of_the_begin_the_inputs_and_the_outcome(make):
    told = []

    class Execution(hooks.HookedExecution):
        def __enter__(self):
            told.append('begins')
            return self

        def __exit__(self, kind, error, trace):
            told.append(self.outcome)

    class Hook(hooks.ExecutionHook):
        def execution(self, container):
            return Execution()

        def take_inputs(self, container, copy, parent_ud):
            told.append('done' in container.userdata)
            copy()
            told.append(container.userdata.done)

    container = make(Fixed())
    container.register_input_keys(['done'])
    container.execution_hook = Hook()
    given = smach.UserData()
    given.done = 3
    assert container.execute(given) == 'ok' and told == ['begins', False, 3, 'ok']


def test_an_iterator_goes_through_what_the_hook_returns():
    class Hook(hooks.ExecutionHook):
        def items(self, container, items):
            return lambda: list(items) * 2

    state = Fixed()
    container = iterator(state, items=(1, 2, 3))
    container.execution_hook = Hook()
    assert container.execute() == 'ok' and state.runs == 6


def test_a_hook_is_told_which_container_executes_since_a_copy_has_it_too(make):
    seen = []

    class Hook(hooks.ExecutionHook):
        def execution(self, container):
            seen.append(container)
            return super().execution(container)

    container = make(Fixed())
    container.execution_hook = Hook()
    twin = copy.copy(container)
    twin.execute()
    assert seen == [twin]
