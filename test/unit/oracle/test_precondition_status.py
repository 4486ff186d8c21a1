"""How the preconditions of a question's choices stand while it is open: looked at, never brought
about.
"""

from machines import FakeExpert, Scripted, goto, in_thread, watched
from test_preconditions import Hanging, machine_with

from smach_oracle.oracle.records.events import EventKind


def asked(preconditions, strict=True, **settings):
    """The machine after a question about B, and the question; what its preconditions say is asked
    while it is open.
    """
    found = []

    class Looking(FakeExpert):
        def ask(self, question, cancelled, progress):
            look = question.preconditions
            found.extend(
                (look.names[number],) + tuple(look.status(number))
                for number in range(len(look.names))
            )
            return super().ask(question, cancelled, progress)

    machine = watched(
        Scripted(),
        Scripted('aborted'),
        Scripted(),
        expert=Looking(goto('C')),
        preconditions=preconditions,
        strict=strict,
        settings=dict({'max_recoveries': 0}, **settings),
    )
    machine.machine.userdata.cup = 'mug'
    assert machine.run() == 'done'
    return machine, found


def test_a_function_tells_and_a_state_is_not_run():
    def has_cup(userdata):
        return userdata.cup == 'mug'

    def is_dark(userdata):
        return []

    machine, found = asked({'B': [has_cup, is_dark, 'A'], 'C': ['B', Scripted()]})
    assert [each[:2] for each in found] == [
        (('B', 'has_cup'), True),
        (('B', 'is_dark'), False),
        (('B', 'A'), None),
        (('C', 'B'), None),
        (('C', 'Scripted'), None),
    ]
    assert found[2][2] == 'only running A would tell; its last visit succeeded'
    assert found[3][2] == 'only running B would tell; its last visit failed'
    assert machine.visits() == ['A', 'B', 'C']
    assert not machine.of(EventKind.PRECONDITION_START)


def test_of_a_pair_the_check_alone_is_called():
    opened = []

    def gripper_is_open(userdata):
        return False

    def open_it(userdata):
        opened.append(userdata)

    _, found = asked({'B': [(gripper_is_open, open_it)]})
    assert found[0][1:] == (False, 'gripper_is_open returned False; open_it would bring it about')
    assert not opened


def test_of_a_pair_whose_check_holds_or_cannot_tell_nothing_more_is_said():
    def gripper_is_open(userdata):
        return True

    def open_it(userdata):
        raise AssertionError('nobody is to open it')

    _, found = asked({'B': [(gripper_is_open, open_it), ('C', open_it)]})
    assert [each[1:] for each in found] == [
        (True, 'gripper_is_open returned True'),
        (None, 'only running C would tell'),
    ]


def test_what_it_writes_is_dropped_and_what_it_raises_is_told():
    def meddles(userdata):
        userdata.cup = 'broken'
        return True

    def breaks(userdata):
        raise KeyError('nothing there')

    def forgets(userdata):
        pass

    machine, found = asked({'B': [meddles, breaks, forgets]})
    assert [each[1] for each in found] == [True, None, None]
    assert "breaks raised KeyError('nothing there')" == found[1][2]
    assert 'returned None' in found[2][2]
    assert machine.machine.userdata.cup == 'mug'


def test_it_can_be_switched_off():
    called = []
    _, found = asked({'B': [called.append]}, watch_preconditions=False)
    assert found[0][1:] == (None, 'expert.watch_preconditions is off')
    assert not called


def test_a_question_without_preconditions_has_nothing_to_look_at():
    assert asked({})[1] == []


def test_of_a_state_that_is_not_there_only_its_name_is_told():
    _, found = asked({'B': ['NOWHERE']}, strict=False)
    assert found == [(('B', 'NOWHERE'), None, 'only running NOWHERE would tell')]


def test_a_function_that_was_left_behind_at_a_preempt_says_so_as_long_as_it_runs():
    hanging = Hanging()
    brief = {'states': {'B': {'grace_period_s': 0.05}}}
    machine = machine_with(hanging, b=Scripted('aborted', 'aborted'), **brief)
    run = in_thread(machine.run)
    assert hanging.entered.wait(20)
    machine.machine.request_preempt()
    assert run.result() == 'preempted'
    (end,) = machine.of(EventKind.PRECONDITION_END)
    assert end.text == 'hanging was stopped by a preempt or a shutdown and was left behind'
    assert in_thread(machine.run).result() == 'aborted'
    hanging.leave()
    why = 'hanging still runs since a preempt or a shutdown'
    assert why in machine.of(EventKind.DECISION)[-1].text
