"""Who says whether the robot is well: functions, given with the machine or in the settings, and
ports.
"""

import copy
import threading

import pytest
from fake_clock import FakeClock
from machines import FakeHealth, Scripted, chain_of, in_thread, watched
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.machine import health_watch
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.scope.scope import Reason, Scope

SETTINGS = {'health_settle_s': 0.05}


@pytest.fixture
def health():
    return FakeHealth()


@pytest.mark.parametrize(
    'said, text',
    [
        (False, 'FakeHealth'),
        (type('bool_', (), {'__bool__': lambda self: False})(), 'FakeHealth'),  # of NumPy 1
        (type('bool', (), {'__bool__': lambda self: False})(), 'FakeHealth'),  # of NumPy 2
        ('motors: off', 'FakeHealth: motors: off'),
        (ValueError('no answer'), 'FakeHealth: ValueError: no answer'),
        (None, "FakeHealth returned None; True and '' are well"),
    ],
)
def test_what_a_function_may_say(said, text):
    machine = watched(Scripted('aborted'), health=FakeHealth(said), settings=SETTINGS)
    assert machine.run() == 'done'
    assert machine.of(EventKind.HEALTH_WAIT_START)[0].text == text


def test_a_function_that_does_not_return_counts_as_unwell(monkeypatch):
    monkeypatch.setattr(health_watch, 'FUNCTION_LIMIT_S', 0.1)
    go = threading.Event()

    def sleeps():
        return go.wait(20)

    machine = watched(Scripted('aborted'), health=sleeps, settings=SETTINGS)
    run = in_thread(machine.run)
    assert wait_for(lambda: machine.of(EventKind.HEALTH_WAIT_START), 10)
    assert machine.of(EventKind.HEALTH_WAIT_START)[0].text == 'sleeps does not return'
    go.set()
    assert run.result() == 'done'


def test_a_preempt_does_not_wait_for_a_function():
    entered = threading.Event()

    def sleeps():
        entered.set()
        threading.Event().wait(30)

    machine = watched(Scripted('aborted'), health=sleeps, settings=SETTINGS)
    run = in_thread(machine.run)
    assert entered.wait(10)
    machine.machine.request_preempt()
    assert run.result(10) == 'preempted'


def test_functions_of_the_settings_and_the_given_one_must_all_be_well(health):
    other = FakeHealth()
    machine = watched(
        Scripted('aborted'),
        health=health,
        settings=dict(SETTINGS, healthy={'function': other, 'name': 'battery'}),
    )
    health.said, other.said = [False], [False]
    assert machine.run() == 'done'
    assert machine.of(EventKind.HEALTH_WAIT_START)[0].text == 'battery; FakeHealth'


def test_a_function_that_takes_too_long_counts_as_unwell_whatever_it_says(monkeypatch):
    monkeypatch.setattr(health_watch, 'FUNCTION_LIMIT_S', 0.0)
    port = health_watch.HealthFunctionPort('is_well', lambda: True)
    assert port.why_unwell(Scope()) == 'is_well took too long'


def test_a_topic_that_nobody_listens_to_counts_as_well_and_is_warned_of(log):
    machine = watched(Scripted('aborted'), settings={'healthy': {'topic': '/motors_on'}})
    assert machine.run() == 'done'
    assert machine.run() == 'done'
    assert len(machine.of(EventKind.FAILURE)) == 1
    said = [text for level, text in log if level == 'warn' and text.startswith('healthy')]
    assert said == [
        'healthy: this process is not a ROS node, so topic /motors_on is not listened '
        'to, and its condition holds'
    ]


def test_a_port_for_topics_is_made_once(health, log):
    heard = []

    class Port:
        def why_unwell(self, since_s=None):
            return health()

    def listen(conditions):
        heard.append([condition.source for condition in conditions])
        return Port()

    machine = watched(
        Scripted('aborted'),
        settings=dict(
            SETTINGS,
            healthy=[{'topic': '/motors_on'}, {'function': FakeHealth()}, {'diagnostics': 'Power'}],
        ),
    )
    oracle_of(machine.machine).listen_to_health(listen)
    health.said = ['motors: off']
    assert machine.run() == 'done'
    assert machine.run() == 'done'
    assert heard == [['/motors_on', 'Power']]
    assert not any('is not listened to' in text for _, text in log)
    assert machine.of(EventKind.HEALTH_WAIT_START)[0].text == 'motors: off'


def test_topics_alone_are_looked_at_until_the_robot_has_been_well_for_the_settle_time(health):
    class Port:
        def why_unwell(self, since_s=None):
            return health()

    machine = watched(
        Scripted('aborted'),
        settings={'healthy': {'topic': '/motors_on'}, 'health_settle_s': 0.3},
    )
    oracle_of(machine.machine).listen_to_health(lambda conditions: Port())
    health.said = ['motors: off', '', 'motors: off']
    assert in_thread(machine.run).result() == 'done'
    start, end = machine.of(EventKind.HEALTH_WAIT_START, EventKind.HEALTH_WAIT_END)
    assert (end.outcome, end.data['waited_s'] >= 0.3, health.said) == ('well', True, [])


def test_wrapping_again_keeps_the_function_unless_another_is_given(health):
    machine = chain_of(Scripted())
    OracleContainer.wrap(machine, health=health)
    OracleContainer.wrap(machine)
    assert oracle_of(machine).health is health
    other = FakeHealth()
    OracleContainer.wrap(machine, health=other)
    assert oracle_of(machine).health is other


def test_a_copied_machine_leaves_its_health_behind(health):
    machine = OracleContainer(outcomes=['done', 'aborted', 'preempted'], health=health)
    with machine:
        smach.StateMachine.add('A', Scripted(), {'ok': 'done'})
    twin = copy.deepcopy(machine)
    assert oracle_of(twin).health is None and oracle_of(machine).health is health
    assert twin.execute() == 'done'


@pytest.mark.parametrize('is_asked_meanwhile', [True, False])
def test_what_a_call_says_too_late_is_dropped(monkeypatch, is_asked_meanwhile):
    begun, go, ended = threading.Event(), threading.Event(), threading.Event()

    def is_well():
        if begun.is_set():
            return 'motors: off'
        begun.set()
        assert go.wait(20)
        ended.set()
        return True  # as it was when it began

    port = health_watch.HealthFunctionPort('is_well', is_well)
    preempted = Scope(look=lambda: Reason.PREEMPTED if begun.is_set() else None)
    assert port.why_unwell(preempted) == ''  # nobody waits for it
    if is_asked_meanwhile:
        monkeypatch.setattr(health_watch, 'FUNCTION_LIMIT_S', 0.0)
        assert port.why_unwell(Scope()) == 'is_well does not return'
        monkeypatch.undo()
    go.set()
    assert ended.wait(10) and wait_for(port._call.done.is_set)
    assert port.why_unwell(Scope()) == 'is_well: motors: off'


def test_a_port_for_topics_is_not_made_where_there_are_functions_alone(health):
    machine, made = watched(Scripted(), health=health, settings=SETTINGS), []
    oracle_of(machine.machine).listen_to_health(made.append)
    assert machine.run() == 'done' and not made


def test_a_function_is_late_at_the_very_end_of_its_limit():
    def never():
        entered.set()
        assert go.wait(20)

    entered, go, clock = threading.Event(), threading.Event(), FakeClock()
    watch = health_watch.HealthWatch(never)
    watch.use((), 0.0)
    call = in_thread(lambda: watch.why_unwell(Scope(clock=clock)))
    assert entered.wait(20)
    clock.advance(health_watch.FUNCTION_LIMIT_S)
    assert call.result() == 'never does not return'
    go.set()


def test_a_preempt_while_it_is_looked_again_ends_the_wait_and_nothing_is_well():
    def is_well():
        if asked:
            machine.machine.request_preempt()
            assert go.wait(20)
        asked.append(1)
        return 'off'

    asked, go = [], threading.Event()
    machine = watched(Scripted('aborted'), health=is_well, settings={'health_settle_s': 0.0})
    assert machine.run() == 'preempted'
    go.set()
    assert [event.outcome for event in machine.of(EventKind.HEALTH_WAIT_END)] == ['stopped']


def test_who_asks_while_another_asks_waits_for_its_turn():
    def is_well():
        entered.set()
        assert go.wait(20)
        return 'off'

    entered, go, watch = threading.Event(), threading.Event(), health_watch.HealthWatch(is_well)
    watch.use((), 0.0)
    calls = [in_thread(lambda: watch.why_unwell(Scope()))]
    assert entered.wait(20)
    calls.append(in_thread(lambda: watch.why_unwell(Scope())))
    go.set()
    assert [call.result() for call in calls] == ['is_well: off'] * 2


def test_who_waits_for_its_turn_does_not_look_all_the_time():
    class Counted(Scope):
        def wait(self, seconds=None, until=None):
            waits.append(until)
            if len(waits) > 2:
                spins.set()
            return Scope.wait(self, seconds, until)

    def is_well():
        entered.set()
        assert go.wait(20)
        return True

    entered, go, spins, waits = threading.Event(), threading.Event(), threading.Event(), []
    watch = health_watch.HealthWatch(is_well)
    watch.use((), 0.0)
    go.set()
    assert watch.why_unwell(Scope()) == ''
    go.clear()
    entered.clear()
    calls = [in_thread(lambda: watch.why_unwell(Scope()))]
    assert entered.wait(20)
    calls.append(in_thread(lambda: watch.why_unwell(Counted())))
    assert wait_for(lambda: waits) and not spins.wait(0.2)
    go.set()
    assert [call.result() for call in calls] == ['', '']
