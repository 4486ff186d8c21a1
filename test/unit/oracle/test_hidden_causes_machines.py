"""Machines drawn at random: they are like public programs, and only causes make them fail."""

import collections

import pytest
from hidden_causes import figures
from hidden_causes.causes import draw_causes, places_of
from hidden_causes.drawing import draw
from hidden_causes.mix import MIX
from hidden_causes.orders import Arm
from hidden_causes.plan import CONCURRENT, DONE, ITERATED, MACHINE, Box, Leaf, boxes_of, leaves_of
from hidden_causes.running import TRUE, Bed, run_machine

MACHINES = [draw(seed) for seed in range(600)]
PLAIN = [box for machine in MACHINES for box in boxes_of(machine) if box.kind == MACHINE]
UNDISTURBED = MIX._replace(amount=(1e-12, 2e-12), noise=0.0, sure=1.0, fades=0.0)


def shares(counts):
    total = sum(counts.values())
    return {key: count / total for key, count in counts.items()}


def lead_of(box, child, target):
    """Where an outcome leads, as the figures name it."""
    labels = [each.label for each in box.children]
    if target not in labels:
        return 'leave'
    steps = labels.index(target) - labels.index(child.label)
    return {0: 'self', 1: 'next'}.get(steps, 'forward' if steps > 0 else 'back')


def leads_of(kind):
    """How many outcomes of a kind lead where."""
    counts = collections.Counter()
    for box in PLAIN:
        for child in box.children:
            work, failing = (
                (child.work, child.failing) if isinstance(child, Leaf) else ((DONE,), child.ends)
            )
            for outcome in work if kind == 'work' else failing:
                counts[lead_of(box, child, child.leads[outcome])] += 1
    return counts


def loops(box):
    """Whether a state of a container leads back to itself by some way."""
    labels = {child.label: child for child in box.children}

    def reached(label):
        found, left = set(), [label]
        while left:
            more = set(labels[left.pop()].leads.values()) & set(labels)
            left += more - found
            found |= more
        return found

    return any(label in reached(label) for label in labels)


@pytest.mark.parametrize('kind', ['work', 'failing'])
def test_outcomes_lead_where_those_of_public_programs_lead(kind):
    found, wanted = shares(leads_of(kind)), shares(figures.LEADS[kind])
    assert found == {lead: pytest.approx(share, abs=0.04) for lead, share in wanted.items()}


def test_states_have_as_many_outcomes_of_each_kind_as_in_public_programs():
    drawn = collections.Counter(
        (len(leaf.work), len(leaf.failing), int(leaf.is_preemptable))
        for box in PLAIN
        for leaf in box.children
        if isinstance(leaf, Leaf)
    )
    found, wanted = shares(drawn), shares(figures.OUTCOMES)
    often = {key: share for key, share in wanted.items() if share > 0.02}
    assert {key: found[key] for key in often} == pytest.approx(often, abs=0.025)


def test_programs_have_as_many_containers_and_these_as_many_states_as_public_ones():
    found = shares(collections.Counter(len(box.children) for box in PLAIN))
    mean = sum(states * share for states, share in found.items())
    wanted = shares(figures.STATES)
    # a program of one container has three states or more, and so more than a container has
    assert mean == pytest.approx(sum(key * share for key, share in wanted.items()), abs=0.8)
    assert max(found) > 15
    counts = shares(collections.Counter(len(boxes_of(machine)) for machine in MACHINES))
    # an Iterator holds a container, and so counts as two
    assert counts[1] == pytest.approx(shares(figures.CONTAINERS)[1], abs=0.06)
    assert max(counts) >= 10
    sizes = [sum(1 for _ in leaves_of(machine)) for machine in MACHINES]
    assert sum(sizes) / len(sizes) == pytest.approx(9.3, abs=1.5)


def test_as_many_containers_loop_as_of_public_programs():
    looping = sum(map(loops, PLAIN)) / len(PLAIN)
    assert looping == pytest.approx(figures.WITH_A_LOOP / 403, abs=0.06)


def test_failing_outcomes_have_the_names_of_public_programs():
    ends = collections.Counter()
    for box in PLAIN:
        for leaf in box.children:
            for outcome in getattr(leaf, 'failing', ()):
                if leaf.leads[outcome] in box.ends:
                    ends[leaf.leads[outcome] == outcome] += 1
    # one that the author names `aborted` has an end of its name anyway
    assert figures.SAME_NAME <= ends[True] / (ends[True] + ends[False]) < 0.95
    names = collections.Counter(
        leaf.failing[0] for machine in MACHINES for leaf in leaves_of(machine) if leaf.failing
    )
    found, wanted = shares(names), shares(figures.FAILING_NAMES)
    assert found['aborted'] == pytest.approx(wanted['aborted'], abs=0.08)
    assert set(names) == set(figures.FAILING_NAMES)


def test_there_are_machines_with_concurrences_and_iterators():
    kinds = collections.Counter(box.kind for machine in MACHINES for box in boxes_of(machine))
    nested = sum(kinds.values()) - len(MACHINES)
    assert kinds[CONCURRENT] > 0.01 * nested and kinds[ITERATED] > 0.03 * nested
    assert all(
        isinstance(child, Leaf)
        for machine in MACHINES
        for box in boxes_of(machine)
        if box.kind == CONCURRENT
        for child in box.children
    )


@pytest.mark.parametrize('first', range(0, 60, 20))
def test_a_machine_that_nothing_disturbs_does_all_of_its_work(first):
    for seed in range(first, first + 20):
        for trial in run_machine(seed, Arm('bare'), 3, UNDISTURBED):
            assert (trial.ended, trial.failures, trial.harm) == (TRUE, 0, 0), seed


def test_every_machine_is_one_that_smach_takes():
    for seed in range(0, 600, 7):
        box = draw(seed)
        with Bed(box, draw_causes(seed, box, MIX), None) as bed:
            bed.machine.check_consistency()
            assert set(bed.machine.get_registered_outcomes()) == set(box.outcomes)


def test_the_same_seed_draws_the_same_machine_and_causes():
    for seed in (1, 2):
        box = draw(seed)
        assert box == draw(seed) and box != draw(seed + 1)
        assert draw_causes(seed, box, MIX) == draw_causes(seed, box, MIX)
        assert draw_causes(seed, box, MIX) != draw_causes(seed + 1, box, MIX)


def distances(causes, box):
    """How far before the state that needs a condition the state lies that makes it."""
    order = [place.leaf.path for place in places_of(box)]
    for path, work in causes.works.items():
        for name in work.needs:
            for maker in causes.conditions[name].makers:
                if maker in order:
                    yield order.index(path) - order.index(maker), maker, path


def test_causes_lie_some_states_back_also_in_other_containers():
    steps, across = collections.Counter(), 0
    for seed, box in enumerate(MACHINES[:200]):
        for count, maker, path in distances(draw_causes(seed, box, MIX), box):
            steps[count] += 1
            across += maker.rsplit('/', 1)[0] != path.rsplit('/', 1)[0]
    assert min(steps) >= 1
    found = shares(steps)
    assert 0.3 < found[1] < 0.6 and found[2] > 0.1 and sum(steps[far] for far in range(4, 30)) > 50
    assert across > 100


def test_no_property_of_a_condition_says_what_another_is():
    conditions = [
        condition
        for seed, box in enumerate(MACHINES)
        for condition in draw_causes(seed, box, MIX).conditions.values()
        if condition.holds_at_first
    ]

    def share(of, among):
        chosen = [each for each in conditions if among(each)]
        return sum(map(of, chosen)) / len(chosen)

    def heals(each):
        return each.heals_s is not None

    for among in (
        lambda each: each.is_by_hand,
        lambda each: not each.is_by_hand,
        lambda each: each.worse > 0,
        lambda each: bool(each.makers),
    ):
        assert share(heals, among) == pytest.approx(MIX.heals['around'], abs=0.06)
    hopeless = share(
        lambda each: not (each.makers or each.heals_s or each.is_by_hand or each.variant),
        lambda each: True,
    )
    assert 0.02 < hopeless < 0.1, 'some failures have no cure at all'


def test_machines_differ_in_the_mix_and_have_it_on_the_average():
    shares_by_hand, heals = [], []
    for seed, box in enumerate(MACHINES):
        conditions = draw_causes(seed, box, MIX).conditions.values()
        around = [each for each in conditions if each.holds_at_first]
        if len(around) >= 6:
            heals.append(sum(each.heals_s is not None for each in around) / len(around))
        shares_by_hand.append(sum(each.is_by_hand for each in conditions) / len(conditions))
    assert len(heals) > 50
    mean = sum(heals) / len(heals)
    variance = sum((each - mean) ** 2 for each in heals) / len(heals)
    # of machines that all have the mix itself it is 0.023
    assert mean == pytest.approx(MIX.heals['around'], abs=0.06) and variance > 0.04
    assert sum(shares_by_hand) / len(shares_by_hand) == pytest.approx(0.87, abs=0.03)


def test_a_plan_has_its_states_in_the_order_in_which_they_come():
    inner = Box('T/M', MACHINE, (Leaf('T/M/B', (DONE,), (), False, {}),), (), {})
    box = Box('T', MACHINE, (Leaf('T/A', (DONE,), (), False, {}), inner), (), {})
    assert [leaf.label for leaf in leaves_of(box)] == ['A', 'B']
    assert [each.path for each in boxes_of(box)] == ['T', 'T/M']
