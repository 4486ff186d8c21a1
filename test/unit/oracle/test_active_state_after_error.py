"""After an error `get_active_states` names the state that failed, as it does without an oracle."""

import pytest
from machines import FakeExpert, Scripted, chain_of, give_up, supersede

import smach
from smach_oracle.oracle import OracleContainer

ASKS = {'max_recoveries': 0, 'deadline_s': 20.0}
ENDS = {
    'exception': (ValueError('broken'), smach.InvalidUserCodeError),
    'unregistered outcome': ('nonsense', smach.InvalidTransitionError),
    'outcome that leads nowhere': ('unbound', smach.InvalidTransitionError),
}


def machine_that(*ends):
    """A machine of A, B and C, whose B ends so."""
    machine = chain_of(Scripted(), Scripted(*ends), Scripted())
    machine['B'].register_outcomes(['unbound'])
    return machine


def interrupted(question, cancelled, progress):
    raise KeyboardInterrupt


def gives_up(question, cancelled, progress):
    return give_up()


@pytest.mark.parametrize('settings', [ASKS, {}], ids=['asks at once', 'tries again first'])
@pytest.mark.parametrize('expert', [None, gives_up], ids=['nobody', 'expert gives up'])
@pytest.mark.parametrize('end', sorted(ENDS))
def test_the_failed_state_is_the_active_one_after_an_error(end, expert, settings):
    returned, kind = ENDS[end]
    active = []
    for is_wrapped in (False, True):
        machine = machine_that(*[returned] * 20)
        if is_wrapped:
            OracleContainer.wrap(
                machine,
                settings=settings,
                expert=FakeExpert(*[expert] * 20) if expert is not None else None,
            )
        with pytest.raises(kind):
            machine.execute()
        active.append(machine.get_active_states())
    assert active == [['B'], ['B']]


def test_likewise_in_a_nested_machine_and_in_that_around_it():
    inner = machine_that(*[ValueError('broken')] * 20)
    top = chain_of(inner)
    OracleContainer.wrap(top, settings=ASKS)
    with pytest.raises(smach.InvalidUserCodeError):
        top.execute()
    assert (top.get_active_states(), inner.get_active_states()) == (['A'], ['B'])


def test_likewise_where_the_program_is_interrupted_while_an_expert_is_asked():
    machine = machine_that('aborted')
    OracleContainer.wrap(machine, settings=ASKS, expert=FakeExpert(interrupted))
    with pytest.raises(KeyboardInterrupt):
        machine.execute()
    assert machine.get_active_states() == ['B']


def test_the_machine_runs_again_after_the_error():
    machine = machine_that(ValueError('broken'), 'ok')
    OracleContainer.wrap(machine, settings=ASKS)
    with pytest.raises(smach.InvalidUserCodeError):
        machine.execute()
    assert machine.execute() == 'done'
    assert machine.get_active_states() == ['None']


@pytest.mark.parametrize(
    ('end', 'said'),
    [('exception', ["State 'B' ended in an error."]), ('unregistered outcome', [])],
)
def test_where_the_oracle_only_observes_the_log_names_a_state_that_has_raised(
    end, said, monkeypatch
):
    returned, kind = ENDS[end]
    machine = OracleContainer.wrap(machine_that(returned), recover=False)
    logged = []
    monkeypatch.setattr(smach, 'logerr', logged.append)
    with pytest.raises(kind):
        machine.execute()
    assert [text for text in logged if 'ended in an error' in text] == said


def test_a_nested_machine_that_runs_alone_after_the_error_has_nothing_above_it():
    inner = chain_of(Scripted(ValueError('broken'), 'aborted'))
    top = chain_of(Scripted(), inner)
    expert = FakeExpert(give_up(), supersede('ok'))
    OracleContainer.wrap(top, settings={'policy': 'always_ask'}, expert=expert)
    with pytest.raises(smach.InvalidUserCodeError):
        top.execute()
    assert inner.execute() == 'done'
    choices = expert.questions[1].choices
    assert [(choice.container, choice.state) for choice in choices] == [('', 'A')]
