"""What recorded streaks say of another policy: real machines, run by the executive."""

import json
import random

import pytest
from failing_machines import KEPT, Chance, Hand, NoWait, by_trial, record, run

import smach
from smach_oracle.analysis import what_if
from smach_oracle.oracle import OracleContainer, oracle_of
from smach_oracle.oracle.records.events import EventKind


def streaks_under(recorded, settings):
    return what_if.compare(what_if.Recorded(recorded), settings).streaks


def test_a_recorded_policy_agrees_with_itself_in_each_streak():
    recorded = run(60, **{**KEPT, 'policy': 'escalating'})
    bounds, estimate = streaks_under(recorded, {})
    assert bounds.agree == bounds.streaks > 20
    assert all(low == high for low, high in bounds.ranges.values()) and estimate is None
    asked = [event for trial in recorded for event in trial if event.kind == EventKind.QUERY_OPENED]
    assert bounds.ranges['questions'][0] == pytest.approx(len(asked) / bounds.streaks)


def test_the_bounds_hold_what_another_run_under_the_other_policy_comes_to():
    dear = {'expert_minute': 0.0, 'harm': 0.0}
    recorded = run(100, seed=3, **{**KEPT, 'policy': 'escalating'})
    bounds, _ = streaks_under(recorded, {'cost.' + name: price for name, price in dear.items()})
    assert 0 < bounds.agree < bounds.streaks
    own = run(100, seed=4, **{**KEPT, 'policy': 'escalating', 'cost': dear})
    measured = {name: low for name, (low, _) in streaks_under(own, {})[0].ranges.items()}
    for name in ('cured', 'questions', 'cost'):
        low, high = bounds.ranges[name]
        assert low < high and low <= measured[name] <= high


def test_what_a_person_ends_meanwhile_has_no_known_end():
    recorded = run(60, back_to='LOOK', **{**KEPT, 'policy': 'escalating'})
    bounds, _ = streaks_under(recorded, {})
    assert bounds.left_out > 0


def test_a_policy_without_a_menu_has_no_streaks_and_a_record_without_menus_none_that_are_known():
    recorded = run(60, **{**KEPT, 'policy': 'escalating'})
    assert streaks_under(recorded, {'policy': 'prose'}) is None
    bounds, estimate = streaks_under(run(60, **KEPT), {'policy': 'escalating'})
    assert bounds.streaks == 0 < bounds.left_out and estimate is None


class Causes(smach.State):
    """Fails for one of four causes until the way that cures it is gone, which the world sees."""

    def __init__(self, generator):
        super().__init__(outcomes=['succeeded', 'aborted'])
        self._generator = generator
        self.cause = ''

    def begin(self):
        self.cause = self._generator.choice(['', 'again', 'wait', 'back', 'nothing'])

    def observe(self, event):
        if event.kind == EventKind.JUMP and self.cause in event.data.get('way', ''):
            self.cause = ''
        elif event.kind == EventKind.JUMP and 'from' in event.data.get('way', ''):
            self.cause = '' if self.cause == 'back' else self.cause

    def execute(self, userdata):
        return 'aborted' if self.cause else 'succeeded'


def run_causes(count, world, **policy):
    """Trials in which a failure has each of the four causes as often."""
    generator = random.Random(world)
    look, pick = Chance(generator, 0.0), Causes(generator)
    machine = smach.StateMachine(outcomes=['succeeded', 'aborted'])
    with machine:
        smach.StateMachine.add('LOOK', look, {'succeeded': 'PICK'})
        smach.StateMachine.add('PICK', pick)
    OracleContainer.wrap(
        machine, name='TOP', expert=Hand(random.Random(0)), settings={'policy': policy}
    )
    oracle_of(machine).waiting = NoWait()
    events = []
    machine.events.observers += [events.append, pick.observe]
    for _ in range(count):
        pick.begin()
        machine.execute()
    return by_trial(events)


def test_weighted_streaks_tell_what_the_other_policy_comes_to_in_a_known_world():
    """Where steps back do not pay, and the oracle asks, half of the causes are cured."""
    covered = 0
    for seed in range(6):
        recorded = run_causes(300, seed, name='escalating', explore=0.5, seed=seed)
        bounds, estimate = streaks_under(recorded, {'policy': 'escalating', 'cost.harm': 9e5})
        assert estimate.why_not == ''
        low, high = estimate.intervals['cured']
        assert 0.2 < low < high < 0.85
        covered += low <= 0.5 <= high
        # the bounds alone say much less
        assert bounds.ranges['cured'][0] < low and high < bounds.ranges['cured'][1]
    assert covered >= 5


def test_the_command_tells_of_streaks_in_words_and_as_json(tmp_path, capsys):
    record(tmp_path / 'bags', run_causes(100, 1, name='escalating', explore=0.5))
    capsys.readouterr()
    out = str(tmp_path / 'out.json')
    assert what_if.main([str(tmp_path / 'bags'), '--policy', 'escalating', '--json', out]) == 0
    told = capsys.readouterr().out
    assert 'policy escalating: ' in told and ' streaks agree' in told
    (tried,) = json.loads((tmp_path / 'out.json').read_text())['folders'][0]['tried']
    assert tried['streaks']['streaks'] > tried['streaks']['agree'] > 0
    assert set(tried['streaks']['weighted']['intervals']) in ({'cured', 'questions', 'cost'}, set())
