"""Results of ways, read from the events of machines that the executive has run."""

import contextlib
import random

import pytest
from fake_clock import FakeClock

import smach
from smach_oracle.analysis.replaying.way_reader import WayReader
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.oracle.decision.ways import BY_PERSON, FIRST, LATER
from smach_oracle.oracle.machine.nesting import nodes_of
from smach_oracle.oracle.records import events as event_source
from smach_oracle.oracle.records.events import EventKind

ALL = ['succeeded', 'aborted', 'preempted']


class Scripted(smach.State):
    """Ends as its script says, and succeeds once that is over."""

    def __init__(self, *script):
        super().__init__(outcomes=ALL)
        self.script = list(script)
        self.doing = lambda: None

    def execute(self, userdata):
        if not self.script:
            return 'succeeded'
        outcome = self.script.pop(0)
        if callable(outcome):
            outcome = outcome()
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome


class Answers(Expert):
    """Gives prepared answers, and none once they are spent."""

    def __init__(self, *answers):
        self._answers = list(answers)

    def ask(self, question, cancelled, progress):
        return self._answers.pop(0) if self._answers else None


class NoWait:
    """Takes no time."""

    def wait(self, seconds, what, scope):
        pass


def machine_of(look, pick, reach=None, policy='escalating', **more):
    inner = smach.StateMachine(outcomes=ALL)
    with inner:
        smach.StateMachine.add('REACH', reach or Scripted())
    machine = smach.StateMachine(outcomes=ALL)
    with machine:
        smach.StateMachine.add('LOOK', look, {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', pick, {'succeeded': 'INNER'})
        smach.StateMachine.add('INNER', inner)
    OracleContainer.wrap(machine, name='TOP', settings={'policy': policy}, **more)
    oracle_of(machine).waiting = NoWait()
    return machine


def read(machine, trials=1):
    """Run it, and return the results by state, without their minutes and kinds of failure."""
    events = []
    machine.events.observers.append(events.append)
    for _ in range(trials):
        with contextlib.suppress(KeyboardInterrupt, smach.InvalidUserCodeError):
            machine.execute()
    return {
        '/'.join(key): [(each.way, each.kind, each.place, each.helped) for each in results]
        for key, results in results_in(events).items()
    }


def results_in(events):
    reader = WayReader()
    for event in events:
        reader.take(event)
    return {key: list(log.results) for key, log in reader.logs.items()}


def test_a_way_helped_if_the_next_result_is_a_success_and_not_if_it_is_a_failure():
    found = read(machine_of(Scripted(), Scripted('aborted', 'aborted')))
    assert found == {
        'TOP/PICK': [('again', 'again', FIRST, False), ('wait 10 s', 'wait', LATER, True)]
    }


def test_a_failure_of_another_kind_is_no_help_and_has_another_name():
    machine = machine_of(Scripted(), Scripted('aborted', RuntimeError('arm 3 at 0.5 m')))
    events = []
    machine.events.observers.append(events.append)
    machine.execute()
    results = results_in(events)['TOP', 'PICK']
    assert [each.helped for each in results] == [False, True]
    assert results[0].failure == 'fell_through aborted'
    assert results[1].failure == 'exception: RuntimeError: arm # at # m'


def test_a_success_of_another_state_decides_nothing():
    look, pick = Scripted('aborted'), Scripted('aborted', 'aborted', 'aborted')
    found = read(machine_of(look, pick))
    assert [each[3] for each in found['TOP/LOOK']] == [True]
    assert [each[0] for each in found['TOP/PICK']] == ['again', 'wait 10 s', 'from LOOK']
    assert [each[3] for each in found['TOP/PICK']] == [False, False, True]


def test_a_choice_about_a_state_that_was_held_back_is_no_way_from_its_failure_before():
    back, done = (
        Answer(AnswerKind.GOTO, 'LOOK', by='ann'),
        Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='ann'),
    )
    machine = machine_of(Scripted(), Scripted('aborted'))
    settings = {'policy': 'escalating', 'states': {'PICK': {'on_retry': 'never'}}}
    OracleContainer.wrap(machine, settings=settings, expert=Answers(back, back, done))
    found = read(machine)
    assert found == {'TOP/PICK': [('from LOOK', 'step_back', BY_PERSON, None)]}
    (record,) = (
        node.records.by_label['PICK'] for node in nodes_of(machine) if node.relative_path == ''
    )
    assert [each.way for each in record.ways_so_far()] == ['from LOOK']


def test_a_persons_way_to_the_branch_beside_goes_by_the_name_that_the_executive_gives_it():
    both = smach.Concurrence(ALL, 'aborted', outcome_map={'succeeded': {'RIGHT': 'succeeded'}})
    with both:
        smach.Concurrence.add('LEFT', Scripted('aborted'))
        smach.Concurrence.add('RIGHT', Scripted())
    machine = smach.StateMachine(outcomes=ALL)
    with machine:
        smach.StateMachine.add('BOTH', both)
    settings = {'policy': 'escalating', 'states': {'LEFT': {'on_retry': 'never'}}}
    expert = Answers(Answer(AnswerKind.GOTO, 'RIGHT', container='TOP/BOTH', by='ann'))
    OracleContainer.wrap(machine, name='TOP', settings=settings, expert=expert)
    found = read(machine)
    own = [
        (each.way, each.kind, each.place, each.helped)
        for node in nodes_of(machine)
        for record in node.records.by_label.values()
        for each in record.ways_so_far()
    ]
    assert own and found == {'TOP/BOTH/LEFT': own}


def test_a_step_back_out_of_a_container_belongs_to_the_state_that_failed():
    found = read(machine_of(Scripted(), Scripted(), Scripted(*['aborted'] * 3)))
    assert list(found) == ['TOP/INNER/REACH']
    assert [each[2:] for each in found['TOP/INNER/REACH']] == [
        (FIRST, False),
        (LATER, False),
        (LATER, True),
    ]
    assert found['TOP/INNER/REACH'][2][0].startswith('from /')


def test_a_trial_that_ends_in_failure_shows_that_the_way_did_not_help():
    # PICK leads back to LOOK, whose failures nobody is there to end otherwise
    pick = Scripted('aborted', 'aborted', 'aborted')
    found = read(machine_of(Scripted('succeeded', *['aborted'] * 9), pick))
    assert found['TOP/PICK'][-1] == ('from LOOK', 'step_back', LATER, False)


def test_a_person_who_acts_meanwhile_leaves_it_unknown_and_the_persons_choice_has_a_result():
    back = Answer(AnswerKind.GOTO, state='LOOK', by='hand')
    found = read(machine_of(Scripted(), Scripted(*['aborted'] * 4), expert=Answers(back)))
    assert [each[2:] for each in found['TOP/PICK']] == [
        (FIRST, False),
        (LATER, False),
        (LATER, False),
        (BY_PERSON, True),
    ]
    assert found['TOP/PICK'][-1][:2] == ('from LOOK', 'step_back')
    # LOOK fails on the way back for PICK, and a person does its work
    done = Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='hand')
    look = Scripted('succeeded', *['aborted'] * 5)
    found = read(machine_of(look, Scripted(*['aborted'] * 3), expert=Answers(done)))
    assert found['TOP/PICK'][-1] == ('from LOOK', 'step_back', LATER, None)


def test_a_persons_choice_that_fails_has_not_helped():
    again = Answer(AnswerKind.GOTO, state='PICK', by='hand')
    pick = Scripted(*['aborted'] * 6)
    found = read(machine_of(Scripted(), pick, expert=Answers(again)))
    chosen = [each for each in found['TOP/PICK'] if each[2] == BY_PERSON]
    assert chosen == [('again', 'again', BY_PERSON, False)]


@pytest.mark.parametrize('ending', ['preempt', 'ctrl-c'])
def test_a_preempt_and_a_stop_leave_it_unknown(ending):
    pick = Scripted('aborted')
    machine = machine_of(Scripted(), pick)

    def preempt():
        machine.request_preempt()
        return 'preempted'

    pick.script.append(preempt if ending == 'preempt' else KeyboardInterrupt())
    assert read(machine)['TOP/PICK'] == [('again', 'again', FIRST, None)]


def test_each_trial_begins_with_nothing_pending():
    look, pick = Scripted(), Scripted('aborted', KeyboardInterrupt(), 'aborted')
    found = read(machine_of(look, pick), trials=2)
    assert found['TOP/PICK'] == [('again', 'again', FIRST, None), ('again', 'again', FIRST, True)]


def test_policies_that_go_by_no_menu_teach_nothing():
    assert read(machine_of(Scripted(), Scripted('aborted'), policy='retry')) == {}


# -- the executive's own notes are those that the events tell


class Drawn(smach.State):
    """Ends as is drawn, and now and then raises, or has its machine preempted.

    `clock`: in which it takes up to a minute, None where it takes no time.
    """

    preempt = staticmethod(lambda: None)

    def __init__(self, generator, share, clock=None):
        super().__init__(outcomes=ALL)
        self._generator = generator
        self._share = share
        self._clock = clock

    def execute(self, userdata):
        drawn = self._generator.random()
        if self._clock is not None:
            self._clock.advance(6.0 * int(10.0 * drawn))
        if self._generator.random() < 0.02:
            self.preempt()
        if drawn >= self._share:
            return 'succeeded'
        if drawn < self._share / 4:
            raise RuntimeError('found {} of {}'.format(int(100 * drawn), 'many ' * int(90 * drawn)))
        return 'preempted' if drawn < self._share / 3 else 'aborted'


class DrawnAnswers(Expert):
    """Goes to any state, does the work, gives up, or says nothing, each after five minutes."""

    def __init__(self, generator, clock):
        self._generator = generator
        self._clock = clock

    def ask(self, question, cancelled, progress):
        self._clock.advance(300.0)
        kind = self._generator.choice(['goto', 'goto', 'supersede', 'give up', 'none'])
        if kind == 'goto':
            choice = self._generator.choice(question.choices)
            return Answer(AnswerKind.GOTO, choice.container, choice.state, by='hand')
        if kind == 'supersede':
            return Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='hand')
        return Answer(AnswerKind.GIVE_UP, by='hand') if kind == 'give up' else None


def drawn_machine(seed, clock):
    """A machine with containers in it, among them a Concurrence and an Iterator.

    What runs in two threads takes no time: else it could pass in one of them between an event of
    the other one and what that notes.
    """
    generator = random.Random(seed)

    def chain(*states):
        machine = smach.StateMachine(outcomes=ALL)
        with machine:
            for number, state in enumerate(states):
                onward = (
                    {} if number == len(states) - 1 else {'succeeded': 'S{}'.format(number + 1)}
                )
                smach.StateMachine.add('S{}'.format(number), state, onward)
        return machine

    def leaf(clock=clock):
        return Drawn(random.Random(generator.random()), 0.4, clock)

    both = smach.Concurrence(ALL, 'aborted', outcome_map={'succeeded': {'LEFT': 'succeeded'}})
    with both:
        smach.Concurrence.add('LEFT', chain(leaf(None), leaf(None)))
        smach.Concurrence.add('RIGHT', leaf(None))
    each = smach.Iterator(ALL, [], [], it=[1, 2], it_label='item', exhausted_outcome='succeeded')
    with each:
        smach.Iterator.set_contained_state('EACH', chain(leaf(), leaf()), ['succeeded'])
    return chain(leaf(), chain(leaf(), chain(leaf(), leaf())), both, leaf(), each), generator


def notes_of(machine):
    """What the executive has noted, by state."""
    found = {}
    for node in nodes_of(machine):
        for label, record in node.records.by_label.items():
            if record.ways_so_far():
                found[node.path, label] = list(record.ways_so_far())
    return found


@pytest.mark.parametrize('policy', ['escalating', 'any_way', 'learned'])
@pytest.mark.parametrize('seed', range(3))
def test_the_executive_notes_what_its_events_tell(seed, policy, monkeypatch):
    clock = FakeClock()
    monkeypatch.setattr(event_source, 'time', clock.now)
    machine, generator = drawn_machine(seed, clock)
    monkeypatch.setattr(Drawn, 'preempt', staticmethod(machine.request_preempt))
    expert = DrawnAnswers(generator, clock)
    OracleContainer.wrap(machine, name='TOP', settings={'policy': policy}, expert=expert)
    oracle_of(machine).waiting = NoWait()
    oracle_of(machine).count_work_by(clock)
    events = []
    machine.events.observers.append(events.append)
    for _ in range(16):
        with contextlib.suppress(smach.InvalidUserCodeError):
            machine.execute()
    assert any(event.kind is EventKind.PREEMPT for event in events)
    noted = notes_of(machine)
    assert sum(map(len, noted.values())) > 12
    assert any(each.minutes for rows in noted.values() for each in rows)
    assert noted == results_in(events)


@pytest.mark.parametrize('ends', [['aborted', 'aborted'], ['aborted', 'succeeded']])
def test_a_branch_that_ends_before_the_stop_of_the_machine_has_come_to_it_says_nothing(ends):
    """A Concurrence hands a request on to its branches in a thread of its own."""
    right = Scripted(*ends)
    both = smach.Concurrence(ALL, 'aborted')
    with both:
        smach.Concurrence.add('LEFT', Scripted())
        smach.Concurrence.add('RIGHT', right)
    machine = smach.StateMachine(outcomes=ALL)
    with machine:
        smach.StateMachine.add('BOTH', both)
    OracleContainer.wrap(machine, name='TOP', settings={'policy': 'escalating'})
    oracle_of(machine).waiting = NoWait()
    last = right.script.pop()

    def ends_while_only_the_top_machine_is_asked():
        smach.State.request_preempt(machine)
        return last

    right.script.append(ends_while_only_the_top_machine_is_asked)
    events = []
    machine.events.observers.append(events.append)
    machine.execute()
    (noted,) = notes_of(machine).values()
    (told,) = results_in(events).values()
    assert [each.helped for each in noted] == [each.helped for each in told]
