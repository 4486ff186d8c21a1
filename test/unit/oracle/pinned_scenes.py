"""Machines that come to the oracle for each of its reasons, and the events that they tell."""

import os
import threading

from branch_machines import Item, iterator_over
from guarded_machines import OUTCOMES, chain
from held_machines import Held
from machines import (
    FakeExpert,
    FakeHealth,
    Gate,
    Scripted,
    Watched,
    give_up,
    goto,
    interface,
    supersede,
    waits,
)
from pinned import told

import smach

ASKS = {'max_recoveries': 0}


def both(left, right):
    """A Concurrence of LEFT and RIGHT: 'done' where no branch ends badly."""
    concurrence = smach.Concurrence(
        outcomes=OUTCOMES,
        default_outcome='done',
        outcome_map={'aborted': {'LEFT': 'aborted'}, 'preempted': {'LEFT': 'preempted'}},
    )
    with concurrence:
        smach.Concurrence.add('LEFT', left)
        smach.Concurrence.add('RIGHT', right)
    return concurrence


def each(state, *loop):
    """An Iterator of two items. Its state is EACH."""
    iterator = smach.Iterator(
        outcomes=OUTCOMES,
        input_keys=[],
        output_keys=[],
        it=[1, 2],
        it_label='item',
        exhausted_outcome='done',
    )
    with iterator:
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=list(loop))
    return iterator


def run(machine, concurrence='', **wrap):
    """The lines of a run, and how it has ended."""
    watched = Watched(machine, name='TOP', **wrap)
    watched.machine.userdata.done = []
    outcome = watched.run()
    return told(watched.events, concurrence) + ['= {}'.format(outcome)]


# -- where it happens


def nested_machines():
    hand = chain(CLOSE=Scripted('aborted'))
    return run(chain(LOOK=Scripted(), ARM=chain(GRASP=Scripted('aborted'), HAND=hand)))


def handed_up():
    """CLOSE gives up, and so do the containers around it, until LOOK is entered again."""
    hand = chain(CLOSE=Scripted('aborted'))
    return run(
        chain(LOOK=Scripted(), ARM=chain(HAND=hand)),
        expert=FakeExpert(goto('LOOK', container='TOP')),
        settings=ASKS,
    )


def concurrence():
    """LEFT is a plain state, RIGHT a machine. Both fail once."""
    return run(
        chain(BOTH=both(Scripted('aborted'), chain(R=Scripted('aborted')))), concurrence='TOP/BOTH'
    )


def branch_given_up():
    return run(
        chain(BOTH=both(Scripted('aborted'), Scripted())),
        concurrence='TOP/BOTH',
        expert=FakeExpert(give_up(), goto('BOTH')),
        settings=ASKS,
    )


def iterator():
    return run(
        chain(ALL=iterator_over(Item(item2=['aborted', ValueError('slipped')]), items=(1, 2, 3)))
    )


def item_passed_over():
    return run(
        chain(
            ALL=iterator_over(
                Item(item2=['aborted']), items=(1, 2, 3), loop_outcomes=['ok', 'aborted']
            )
        )
    )


def iterator_gone_on_with():
    """Its second item is left for a state before, from which the machine comes back to it."""
    each = Item(item2=['aborted', 'aborted'])
    return run(
        chain(LOOK=Scripted(), ALL=iterator_over(each, items=(1, 2, 3))),
        expert=FakeExpert(goto('LOOK', container='TOP'), goto('ALL', container='TOP')),
        settings=ASKS,
    )


def iterator_in_concurrence():
    return run(
        chain(BOTH=both(each(Scripted('aborted'), 'ok'), Scripted())), concurrence='TOP/BOTH'
    )


def concurrence_in_iterator():
    return run(
        chain(ALL=each(both(Scripted('ok', 'aborted'), Scripted()), 'done')),
        concurrence='TOP/ALL/EACH',
    )


# -- why the oracle is entered


def failed():
    """By each kind of failure; answered in each way."""
    return run(
        chain(
            A=Scripted('aborted'),
            B=Scripted(ValueError('slipped')),
            C=Scripted('unheard_of'),
            D=Scripted('aborted'),
        ),
        expert=FakeExpert(
            goto('A', why='look again'), supersede('ok'), goto('B'), give_up('aborted')
        ),
        settings=ASKS,
    )


def failed_as_drawn():
    """Its author has drawn where 'aborted' leads to."""
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('A', Scripted('aborted'), {'ok': 'B', 'aborted': 'aborted'})
        smach.StateMachine.add('B', Scripted('aborted'), {'ok': 'done', 'aborted': 'TIDY'})
        smach.StateMachine.add('TIDY', Scripted(), {'ok': 'B'})
    return run(machine)


def failed_by_policy():
    """What the policy decides, with a precondition that is not met at first."""
    met = iter([False, True, True, True])
    return run(
        chain(A=Scripted(), B=Scripted('aborted', 'aborted', 'aborted')),
        preconditions={'B': [lambda ud: next(met)]},
    )


def given_up_by_itself():
    return run(chain(A=Scripted(*['aborted'] * 3)), settings={'max_recoveries': 1})


def escalated():
    """The oracle of GRASP is unsure, and that of the machine above decides."""
    return run(
        chain(FIND=Scripted(), PICK=chain(GRASP=Scripted('aborted', 'aborted'))),
        settings={'memory': 1000, 'escalate': True, 'states': {'GRASP': {'prior': 0.5}}},
    )


def nobody_answers():
    return run(
        chain(A=Scripted(), B=Scripted('aborted')),
        expert=FakeExpert(),
        settings={'max_recoveries': 0, 'on_no_answer': {'goto': 'A'}},
    )


def done_by_an_interface():
    """The first time it is of no help."""
    helps = iter([None, supersede('ok')])
    return run(
        chain(A=Scripted('aborted')),
        expert=FakeExpert(
            interface('hand'), interface('hand'), interface=lambda *given: next(helps)
        ),
        settings={'max_recoveries': 0, 'interfaces': {'hand': {'action': 'hand/assist'}}},
    )


def overran():
    return run(
        chain(A=Scripted(Gate()), B=Scripted()),
        settings={'states': {'A': {'time_limit_s': 0.05, 'grace_period_s': 20.0}}},
    )


def held_back():
    pour = Scripted()
    return run(
        chain(LOOK=Scripted(), POUR=pour, PLACE=Scripted('aborted')),
        expert=FakeExpert(goto('LOOK'), supersede('ok')),
        settings={'max_recoveries': 0, 'states': {'POUR': {'on_retry': 'confirm'}}},
    )


def taken_out():
    """It still runs when an expert sends the machine on."""
    return run(
        chain(A=Scripted('aborted', Gate()), B=Scripted()),
        expert=FakeExpert(goto('B')),
        settings={'still_running_s': 0.05, 'still_running_factor': 1},
    )


def arrived():
    """From a branch, up to a state of the machine."""
    entered = threading.Event()

    def right(state, ud):
        return 'ok' if state.runs > 1 else (entered.set(), Gate()(state, ud))[1]

    def left(state, ud):
        assert entered.wait(20)
        return 'aborted'

    return run(
        chain(LOOK=Scripted(), BOTH=both(Scripted(left), Scripted(right))),
        concurrence='TOP/BOTH',
        expert=FakeExpert(goto('LOOK', container='TOP')),
        settings=ASKS,
    )


def arrived_down():
    """Into the middle of another machine."""
    return run(
        chain(ARM=chain(GRASP=Scripted(), LIFT=Scripted()), PLACE=Scripted('aborted')),
        expert=FakeExpert(goto('LIFT', container='TOP/ARM')),
        settings=ASKS,
    )


def arrived_where_it_is_closed():
    """WAIT, which is RIGHT as well, still runs when the machine arrives there."""
    over, entered = threading.Event(), threading.Event()

    def stubborn(state, ud):
        entered.set()
        assert over.wait(20)
        return 'ok'

    def left(state, ud):
        assert entered.wait(20)
        return 'aborted'

    def answered(question, cancelled, progress):
        over.set()
        return give_up('aborted')

    wait = Scripted('ok', stubborn)
    return run(
        chain(WAIT=wait, BOTH=both(Scripted(left), wait)),
        concurrence='TOP/BOTH',
        expert=FakeExpert(goto('WAIT', container='TOP'), answered),
        settings={
            'max_recoveries': 0,
            'states': {'BOTH/RIGHT': {'time_limit_s': 1.0, 'grace_period_s': 0.1}},
        },
    )


def unwell(times=1, **settings):
    """The robot is not well when A fails, and is well once the machine waits."""
    health = FakeHealth()

    def falls(state, ud):
        health.now = 'motors: off'
        return 'aborted'

    machine = Watched(
        chain(A=Scripted(*[falls] * times)),
        name='TOP',
        health=health,
        settings=dict({'health_settle_s': 0.05}, **settings),
    )
    machine.machine.events.observers.append(
        lambda event: event.kind.name == 'HEALTH_WAIT_START' and setattr(health, 'now', '')
    )
    outcome = machine.run()
    return told(machine.events) + ['= {}'.format(outcome)]


def often_unwell():
    """Once it is not counted, then it is."""
    return unwell(times=2, max_recoveries=1)


def preempted(machine=None):
    """While an expert is asked."""
    asked = threading.Event()

    def ask(question, cancelled, progress):
        asked.set()
        return waits(question, cancelled, progress)

    watched = Watched(
        machine or chain(A=Scripted('aborted')), name='TOP', expert=FakeExpert(ask), settings=ASKS
    )

    def preempt():
        assert asked.wait(20)
        watched.machine.request_preempt()

    thread = threading.Thread(target=preempt)
    thread.start()
    outcome = watched.run()
    thread.join()
    return told(watched.events) + ['= {}'.format(outcome)]


def preempted_as_drawn():
    """Its author has drawn what comes after a preempt."""
    machine = smach.StateMachine(outcomes=OUTCOMES)
    with machine:
        smach.StateMachine.add('A', Scripted('aborted'), {'ok': 'done', 'preempted': 'STOW'})
        smach.StateMachine.add('STOW', Scripted(), {'ok': 'preempted'})
    return preempted(machine)


def sent():
    """An operator sends it elsewhere while it waits to be confirmed."""
    held = Held(
        chain(A=Scripted(), B=Scripted(), C=Scripted()),
        name='TOP',
        settings={'states': {'B': {'autonomy': 'confirm'}}},
    )
    with held.begin():
        held.waits_before('TOP/B')
        held.hand.go_to('', 'C', by='ann')
        outcome = held.end()
    # another thread tells the command
    return told([event for event in held.events if event.kind.name != 'OPERATOR_COMMAND']) + [
        '= {}'.format(outcome)
    ]


def interrupted(folder):
    """The program is killed in POUR, and begun again. That one is given."""
    from killed_machines import in_a_process

    def begin(pour):
        return run(
            chain(LOOK=Scripted(), POUR=Scripted(pour), PLACE=Scripted()),
            settings={
                'checkpoint': str(folder / 'robot.db'),
                'checkpoint_synchronous': 'OFF',
                'checkpoint_wait_s': 60,
                'on_resume': 'recover',
            },
        )

    def killed():
        begin(lambda state, ud: os.kill(os.getpid(), 9))

    assert in_a_process(killed) is None
    return begin('ok')


SCENES = (
    nested_machines,
    handed_up,
    concurrence,
    branch_given_up,
    iterator,
    item_passed_over,
    iterator_gone_on_with,
    iterator_in_concurrence,
    concurrence_in_iterator,
    failed,
    failed_as_drawn,
    failed_by_policy,
    given_up_by_itself,
    escalated,
    nobody_answers,
    done_by_an_interface,
    overran,
    held_back,
    taken_out,
    arrived,
    arrived_down,
    arrived_where_it_is_closed,
    unwell,
    often_unwell,
    preempted,
    preempted_as_drawn,
    sent,
)
