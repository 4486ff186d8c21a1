"""Trees that were killed and go on otherwise: in a changed script, from elsewhere, killed again.

    python3 test/unit/support/pinned_resumptions.py FOLDER [--pin]

writes what each tells to FOLDER, and with --pin the digests to test/data/pinned/resumed.txt.
"""

import contextlib
import io
import json
import random
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from killed_machines import Points, in_a_process
from pinned import write_told
from pinned_trees import Told, plan_of, written
from tree_model.plan import TOP, Leaf, Machine, Repeated, TreePlan, children_of, nodes_below

import smach
from smach_oracle.oracle.errors import OracleError
from smach_oracle.store.state_command import main
from smach_oracle.store.store_file import StoreFile

FIRST = 1000  # number of the first plan: those of `pinned_trees` are others
POINTS = (8, 60)  # among these one is killed, where it has as many
Settings = Dict[str, Any]


class Later(NamedTuple):
    """What is begun after the kill: the script, its settings, and when it is killed once more."""

    plan: TreePlan
    settings: Settings = {}
    dies_at: int = 0  # 0: never


def places_of(plan: TreePlan) -> List[str]:
    """The paths of all states, from below the top machine."""
    return [
        '{}/{}'.format(path, child.label)[len(TOP) + 1 :]
        for path, node in nodes_below(TOP, plan.top)
        for child in children_of(node)
    ]


# -- other scripts


def with_names(plan: TreePlan, names: Dict[str, str]) -> TreePlan:
    """A plan in which states have other labels."""

    def path_of(path: str) -> str:
        return '/'.join(names.get(each, each) for each in path.split('/'))

    def keyed(table: Dict[str, Any]) -> Dict[str, Any]:
        return {names.get(label, label): value for label, value in table.items()}

    def node_of(node: Any) -> Any:
        node = node._replace(label=names.get(node.label, node.label))
        if isinstance(node, Machine):
            return node._replace(
                children=tuple(map(node_of, node.children)),
                transitions={
                    label: {outcome: names.get(to, to) for outcome, to in led.items()}
                    for label, led in keyed(node.transitions).items()
                },
                remappings=keyed(node.remappings),
            )
        return node._replace(child=node_of(node.child)) if isinstance(node, Repeated) else node

    kind, target = plan.on_no_answer
    return plan._replace(
        top=node_of(plan.top),
        on_no_answer=(kind, path_of(target) if kind == 'goto' else target),
        states={
            (path_of(path), names.get(label, label)): own._replace(
                preconditions=tuple(
                    each._replace(name=names.get(each.name, each.name)) if each.is_label else each
                    for each in own.preconditions
                )
            )
            for (path, label), own in plan.states.items()
        },
    )


def with_node(plan: TreePlan, old: Any, new: Any) -> TreePlan:
    """A plan with another node in the place of one."""

    def node_of(node: Any) -> Any:
        if node is old:
            return new
        if isinstance(node, Repeated):
            return node._replace(child=node_of(node.child))
        if isinstance(node, Leaf):
            return node
        return node._replace(children=tuple(map(node_of, node.children)))

    return plan._replace(top=node_of(plan.top))


def changed(plan: TreePlan, chance: random.Random) -> TreePlan:
    """A plan of which one node is another one."""
    nodes = [node for _, node in nodes_below(TOP, plan.top)]
    leafs = [each for node in nodes for each in children_of(node) if isinstance(each, Leaf)]
    machines = [node for node in nodes if isinstance(node, Machine)]
    leaf, machine = chance.choice(leafs), chance.choice(machines)
    loops = [node for node in nodes if isinstance(node, Repeated)] or [None]
    loop = chance.choice(loops)
    first = machine.children[0].label
    changes: List[Callable[[], Tuple[Any, Any]]] = [
        lambda: (leaf, leaf._replace(outcomes=(*leaf.outcomes, 'unsure'))),
        lambda: (leaf, leaf._replace(reads=('a',) if 'a' not in leaf.reads else ())),
        lambda: (machine, machine._replace(children=machine.children[::-1])),
        lambda: (machine, machine._replace(outcomes=(*machine.outcomes, 'unsure'))),
        lambda: (machine, machine._replace(keys=('a',) if 'a' not in machine.keys else ())),
        lambda: (
            machine,
            machine._replace(remappings={**machine.remappings, first: {'a': 'b', 'b': 'a'}}),
        ),
        lambda: (
            machine,
            machine._replace(
                transitions={
                    **machine.transitions,
                    first: {**machine.transitions[first], 'ok': first},
                }
            ),
        ),
        lambda: (
            machine,
            machine._replace(
                children=(*machine.children, leaf._replace(label='NEW')),
                transitions={**machine.transitions, 'NEW': {'ok': 'ok', 'aborted': 'ok'}},
                remappings={**machine.remappings, 'NEW': {}},
            ),
        ),
    ]
    if loop is not None:
        changes.append(lambda: (loop, loop._replace(final_map={'ok': 'aborted'}, items=4)))
    return with_node(plan, *chance.choice(changes)())


def leafs_of(plan: TreePlan) -> Dict[str, Leaf]:
    """The leafs by their paths."""
    return {
        '{}/{}'.format(path, child.label): child
        for path, node in nodes_below(TOP, plan.top)
        for child in children_of(node)
        if isinstance(child, Leaf)
    }


def stood_at(plan: TreePlan, chance: random.Random, store: StoreFile) -> str:
    """The path of the leaf at which a tree was killed, of any leaf where it was at none."""
    leafs, moment = leafs_of(plan), store.moments(store.trials()[-1].number)[-1]
    for path in (moment.path, '{}/{}'.format(moment.path, moment.label)):
        if path in leafs:
            return path
    return chance.choice(sorted(leafs))


def with_a_machine(plan: TreePlan, path: str) -> Tuple[TreePlan, str, str]:
    """A plan in which a leaf lies in a machine of its own; its path there, and before."""
    leaf = leafs_of(plan)[path]
    around = Machine(
        leaf.label,
        leaf.outcomes,
        (leaf._replace(label='IN'),),
        {'IN': {}},
        {'IN': {}},
        tuple(sorted({*leaf.reads, *leaf.writes})),
    )
    short = path[len(TOP) + 1 :]
    states = {place: own for place, own in plan.states.items() if '/'.join(place) != path}
    after = with_node(plan, leaf, around)._replace(states=states, on_no_answer=('stop', ''))
    return after, short + '/IN', short


# -- what comes after the kill


def other_names(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """All have new names, and for most of them the settings say which."""
    labels = {place.rpartition('/')[2] for place in places_of(plan)}
    names = {each: 'NEW_' + each for each in sorted(labels) if chance.random() < 0.7}
    told = {
        old: '/'.join(names.get(each, each) for each in old.split('/')) for old in places_of(plan)
    }
    share = chance.choice((1.0, 1.0, 0.8))
    names_told = {old: new for old, new in told.items() if old != new and chance.random() < share}
    return Later(with_names(plan, names), {'resume_map': names_told})


def moved_down(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """A state lies in a machine of its own."""
    after, inside, before = with_a_machine(plan, stood_at(plan, chance, store))
    on_resume = chance.choice(('recover', 'recover', 'ask'))
    return Later(after, {'resume_map': {before: inside}, 'on_resume': on_resume})


def gone(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """Another state is there in place of the one where it was."""
    label = stood_at(plan, chance, store).rpartition('/')[2]
    others = {each: 'NEW_' + each for each in chance.sample(places_of(plan), 1) if '/' not in each}
    told = {old: new for old, new in others.items() if old != label}
    return Later(with_names(plan, {label: 'OTHER', **told}), {'resume_map': told})


def other_script(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """Something has changed, and nobody has said what to do."""
    after = changed(plan, chance)
    if chance.random() < 0.4:
        after = changed(after, chance)
    return Later(after, {'on_resume': chance.choice(('recover', 'ask'))})


def sent_to_a_state(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """To any state, and some may be repeated."""
    places = places_of(plan)
    leafs = [each for each in places if each.rpartition('/')[2].startswith('L')]
    return Later(
        plan,
        {
            'on_resume': 'state:' + chance.choice(places),
            'resume_repeat': [each for each in leafs if chance.random() < 0.3],
        },
    )


def earlier_moment(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """From any moment, in the same script or with other names."""
    later = Later(plan) if chance.random() < 0.6 else other_names(plan, chance, store)
    moments = store.moments(store.trials()[-1].number)
    return later._replace(settings=dict(later.settings, resume_from=chance.choice(moments).number))


def killed_again(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """As it goes on."""
    return Later(plan, {'on_resume': chance.choice(('recover', 'ask'))}, chance.randrange(1, 9))


def edited(plan: TreePlan, chance: random.Random, store: StoreFile) -> Later:
    """By oracle_state."""
    path = store.path
    commands = [['goto', chance.choice(places_of(plan))], ['edit', 'a="edited"']]
    for command in chance.sample(commands, chance.randint(1, 2)):
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            main([path, *command])
    return Later(plan)


WAYS = (
    other_names,
    moved_down,
    gone,
    other_script,
    sent_to_a_state,
    earlier_moment,
    killed_again,
    edited,
)
TREES = 7 * len(WAYS)


def name_of(number: int) -> str:
    """The name of a tree in the file of digests."""
    return '{}_{:03}'.format(WAYS[number % len(WAYS)].__name__, number)


def tell(number: int, folder: Path) -> List[str]:
    """What a killed tree tells as it goes on, and what is in its store then."""
    plan = next(
        plan
        for plan in map(plan_of, range(FIRST + 20 * number, sys.maxsize))
        if number % 3 or any(own.on_retry != 'allow' for own in plan.states.values())
    )
    chance = random.Random('resumed {}'.format(number))
    path = str(folder / 'robot.db')
    common = {
        'checkpoint': path,
        'checkpoint_synchronous': 'OFF',
        'checkpoint_wait_s': 60,
        'on_resume': 'recover',
    }

    def run(later: Later, trials: int) -> Any:
        told = _Told(later.plan, **dict(common, **later.settings))
        points = Points(later.dies_at)
        told.machine.events.observers.append(points)
        told.run(trials)
        return {'lines': told.lines, 'points': points.passed}

    first = Later(plan, {}, chance.randrange(*POINTS))
    told = in_a_process(lambda: run(first, 1))
    if told is not None:  # it has ended before
        again = first._replace(dies_at=chance.randrange(2, told['points'] + 1))
        assert in_a_process(lambda: run(again, 1)) is None
    with contextlib.closing(StoreFile(path, 'OFF')) as store:
        later = WAYS[number % len(WAYS)](plan, chance, store)
    lines = []
    if later.dies_at:
        told = in_a_process(lambda: run(later, 1))
        lines += ['KILLED'] if told is None else told['lines']  # or it had ended
    lines += run(later._replace(dies_at=0), 2)['lines']
    ways = sorted(line for line in lines if line.startswith('WAYS '))  # of states in any order
    rest = [line for line in lines if not line.startswith('WAYS ')]
    return [line.replace(str(folder), '.') for line in [*rest, *ways, *_stored(path)]]


class _Told(Told):
    """A tree that tells its refusal, too. In some a value cannot be stored."""

    def __init__(self, plan: TreePlan, **settings: Any) -> None:
        super().__init__(plan, **settings)
        if int(plan.seed.split()[-1]) % 3 == 0:
            self.machine.userdata.c = threading.Lock()

    def execute(self) -> Optional[str]:
        try:
            return super().execute()
        except OracleError as err:
            return '{}: {}'.format(type(err).__name__, written(str(err)))


def _stored(path: str) -> Iterator[str]:
    """All that is in a store. Which facts are in one moment tells, not in which order."""
    with contextlib.closing(StoreFile(path, 'OFF')) as store:
        for trial in store.trials():
            yield 'TRIAL {} {}'.format(trial.number, trial.outcome)
            for fact in sorted(store.facts(trial.number), key=lambda each: each[:6]):
                value = written(json.loads(fact.value.text or 'null'))
                yield 'FACT {} {} {} {}'.format(fact.kind, fact.path, fact.name, value)


def write(folder: Path, pins: bool) -> None:
    """Write what all tell. `pins`: the digests, too."""
    smach.logdebug = lambda text: None
    told = {}
    for number in range(TREES):
        with tempfile.TemporaryDirectory() as store:
            told[name_of(number)] = tell(number, Path(store))
    write_told('resumed', told, folder, pins)


if __name__ == '__main__':
    write(Path(sys.argv[1]), '--pin' in sys.argv)
