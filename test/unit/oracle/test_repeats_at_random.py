"""Machines at random: no guarded state is repeated, as the events alone tell."""

import random

import pytest
from machines import Watched, give_up, goto, supersede

import smach
from smach_oracle.oracle.asking.question import Expert
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.records.facts import Decider, decided_by

OUTCOMES = ['done', 'aborted', 'preempted']


class Chance(smach.State):
    """Fails or succeeds, by chance."""

    def __init__(self, chance, outcomes):
        super().__init__(outcomes=list(outcomes) + ['aborted'])
        self._chance = random.Random(chance.random())  # its thread draws from no other's
        self._good = outcomes

    def execute(self, ud):
        return 'aborted' if self._chance.random() < 0.3 else self._chance.choice(self._good)


class AnyAnswer(Expert):
    """Answers all that may be answered, 40 times."""

    def __init__(self, seed):
        self._seed = seed
        self._left = 40
        self._chances = {}  # by place: two branches may ask at once

    def ask(self, question, cancelled, progress):
        place = '{}: {}/{}'.format(self._seed, question.container_path, question.failed_state)
        chance = self._chances.setdefault(place, random.Random(place))
        self._left -= 1
        drawn = chance.random()
        if self._left < 0 or drawn < 0.1:
            return None
        if drawn < 0.7:
            return goto(chance.choice(question.choices).state)
        if drawn < 0.9:
            return supersede(chance.choice(question.supersede_outcomes).outcome)
        return give_up()


def machine_of(chance, depth, prefix, settings):
    """A machine with nested ones and loops; `settings` of its states are added."""
    machine = smach.StateMachine(outcomes=OUTCOMES)
    labels = [prefix + letter for letter in 'ABCDE'[: chance.randint(2, 5)]]
    with machine:
        for label, following in zip(labels, labels[1:] + ['done']):
            before = labels[: labels.index(label) + 1]
            _add(chance, depth, label, following, before, settings)
            if chance.random() < 0.4:
                settings[label] = {'on_retry': chance.choice(['confirm', 'never'])}
            elif chance.random() < 0.3 and before[:-1]:
                settings[label] = {'preconditions': [chance.choice(before[:-1])]}
    return machine


def _add(chance, depth, label, following, before, settings):
    if depth and chance.random() < 0.35:
        child = machine_of(chance, depth - 1, label + '_', settings)
        if chance.random() < 0.3:
            child = _beside(child, machine_of(chance, 0, label + 'x_', settings))
        smach.StateMachine.add(label, child, {'done': following})
        return
    loops = chance.random() < 0.3
    smach.StateMachine.add(
        label,
        Chance(chance, ['ok', 'ok', 'again'] if loops else ['ok']),
        {'ok': following, **({'again': chance.choice(before)} if loops else {})},
    )


def _beside(left, right):
    both = smach.Concurrence(
        outcomes=['done', 'aborted'],
        default_outcome='aborted',
        outcome_map={'done': {'L': 'done', 'R': 'done'}},
    )
    with both:
        smach.Concurrence.add('L', left)
        smach.Concurrence.add('R', right)
    return both


class Rule:
    """The events that a trial may have where states are guarded, written again from the page."""

    def __init__(self, settings):
        self._settings = settings
        self._latest = {}  # number of the latest visit, by path and state
        self._begun = set()  # guarded states
        self._spent = set()
        self._confirmed = set()
        self._free_jumps = set()  # containers whose next event may be the author's transition
        self.held_back = self.repeated = 0

    def guard(self, place):
        return self._settings.get(place[1], {}).get('on_retry')

    def follow(self, number, event):
        place = (event.path, event.state)
        is_free = event.path in self._free_jumps
        self._free_jumps.discard(event.path)
        if event.kind is EventKind.STATE_START:
            self._begins(number, place)
        elif event.kind is EventKind.DECISION:
            if decided_by(event) is Decider.HELD_BACK:
                assert self.guard(place)
                self.held_back += 1
                self._latest[place] = number
        elif event.kind in (EventKind.SUPERSEDE, EventKind.GIVE_UP):
            self._spent.discard(place)
            self._free_jumps.add(event.path)
        elif event.kind is EventKind.JUMP and not is_free:
            self._jumps(event)

    def _begins(self, number, place):
        if place in self._spent:
            assert self.guard(place) == 'confirm' and place in self._confirmed, place
            self.repeated += 1
        self._spent.discard(place)
        self._confirmed.discard(place)
        self._latest[place] = number
        if self.guard(place):
            self._begun.add(place)

    def _jumps(self, event):
        target = (event.path, event.target)
        since = self._latest.get(target, 0)
        again = {
            place
            for place in self._begun
            if self._latest[place] >= since and (place[0] + '/').startswith(event.path + '/')
        }
        assert event.by or not again, 'the oracle repeats nothing by itself'
        assert target not in self._begun or self.guard(target) == 'confirm', target
        self._spent |= again
        confirmed = {target}
        if 'to' in event.data:  # it crosses containers: so are those on its way down
            names = event.data['to'].split('/')
            confirmed.update(('/'.join(names[:end]), names[end]) for end in range(1, len(names)))
        self._confirmed |= confirmed & self._begun


def followed(seed, policy):
    """Run the machine of a seed, and return the rule, which has followed its events."""
    chance, states = random.Random(seed), {}
    machine = Watched(
        machine_of(chance, 2, '', states),
        expert=AnyAnswer(seed),
        settings={
            'policy': policy,
            'states': states,
            'max_recoveries': 2,
            'escalate': bool(seed % 3),
            'budget': chance.choice([{}, {'recoveries': 5}, {'questions': 5}]),
        },
    )
    assert machine.run() in OUTCOMES
    rule = Rule(states)
    for number, event in enumerate(machine.events, 1):
        try:
            rule.follow(number, event)
        except AssertionError as err:
            told = '\n'.join(map(str, machine.events[:number]))
            raise AssertionError('seed {}: {}\n{}'.format(seed, err, told)) from err
    return rule


@pytest.mark.parametrize('policy', ['prose', 'algorithm1'])
def test_no_guarded_state_is_repeated_unless_confirmed(policy):
    held_back = repeated = 0
    for seed in range(50):
        rule = followed(seed, policy)
        held_back += rule.held_back
        repeated += rule.repeated
    assert held_back > 5 and repeated > 0, 'the machines are such that there is something to see'
