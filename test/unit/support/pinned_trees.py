"""Trees drawn at random, and all that they tell. test/data/pinned/trees.txt has the digests of it.

    python3 test/unit/support/pinned_trees.py FOLDER [--pin]

writes what each tree tells to FOLDER, and with --pin the digests to that file. What users see of a
change is the difference of two folders, of before and after it.
"""

import contextlib
import enum
import hashlib
import json
import random
import re
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Optional
from unittest import mock

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from fake_clock import FakeClock
from killed_machines import Points, in_a_process
from pinned import ADDRESS, FOLDER, SECONDS, rounded
from tree_model.answers import draw_reply
from tree_model.drawing import UPSTREAM, Shape, draw
from tree_model.executing import Executed, answer_of, options_of
from tree_model.plan import TreePlan

import smach
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.oracle.checkpoint.stored_tree import read_tree
from smach_oracle.oracle.control import control
from smach_oracle.oracle.decision.policies import POLICIES
from smach_oracle.oracle.errors import OperatorError
from smach_oracle.oracle.execution import trial, visiting
from smach_oracle.oracle.machine.nesting import nodes_of, records_of
from smach_oracle.oracle.machine.oracle import oracle_of
from smach_oracle.oracle.operator_hand import OperatorHand
from smach_oracle.oracle.prospects import prospects_of
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.store.store_file import StoreFile

TREES, OPERATED, KILLED = 160, 60, 96
IN_ORDER = Shape(depth=3, concurrent=False, time_limits=False)  # one thing at a time
BESIDE = UPSTREAM._replace(depth=3, time_limits=False)  # in every fourth tree
TRIALS = 3
MOST_COMMANDS = 15  # in a trial: an operator could send a machine round without end
RESUMES = ('recover', 'ask', 'recover', 'restart')
# by the first word of a line; all others are events
KINDS = dict(
    {'QUESTION': 'questions', 'INTERFACE': 'questions', '=': 'outcomes', 'PROSPECT': 'prospects'},
    **dict.fromkeys(('COMMAND', 'STATUS'), 'operator'),
    **dict.fromkeys(('INFO', 'WARN', 'ERR'), 'log'),
    **dict.fromkeys(('RATES', 'TRANSITIONS', 'WAYS'), 'learned'),
    **dict.fromkeys(('MOMENT', 'WHOLE', 'CONTAINER'), 'store'),
)
# held elsewhere, or never the same
NOT_TOLD = (
    'settings',
    'failure_rule',
    'origin',
    'trial_id',
    'seq',
    'wall_time',
    'query_id',
    'question_id',
    'minutes',
)
KEY = re.compile(r'"(\w+)": ')
ID = re.compile(r'\b[0-9a-f]{12}\b')
CUT_AT = ('Traceback (most', ' with userdata:', 'InvalidStateError: A ')  # each engine's own
# of moments and events, which threads beside each other draw
DRAWN = re.compile(r'\b(MOMENT|number:|seq:|after:) \d+')


class Told(Executed):
    """A tree under an oracle; `lines` has all that it tells."""

    LOGS_TRANSITIONS = False  # as events say them

    def __init__(self, plan: TreePlan, **settings: Any) -> None:
        self.lines: List[str] = []
        self._more = settings
        super().__init__(plan)
        trial._tell_once.cache_clear()  # what is said once in a process, each tree says
        oracle_of(self.machine).clock = FakeClock()
        self.machine.events.observers.append(self._tell)

    def settings(self) -> Dict[str, Any]:
        return dict(super().settings(), **self._more)

    def expert(self) -> Optional[Expert]:
        return _Asked(self) if self.plan.has_expert else None

    def _tell(self, event: Any) -> None:
        texts = (event.outcome, event.target, event.query_id, event.by, event.text)
        assert all(isinstance(text, str) for text in texts)
        place = '/'.join(filter(None, (event.path, event.state)))
        self.tell(
            '{:15} {}'.format(event.kind.name, place), event._replace(kind=0, path='', state='')
        )

    def tell(self, what: str, value: Any) -> None:
        """Add a line."""
        self.lines.append('{} {}'.format(what, written(value)).rstrip())

    def now(self) -> float:
        """The time by which states take as long as they do.

        None takes any: who is slow on a busy computer would be a dearer way.
        """
        return 0.0

    def run(self, trials: int) -> None:
        """Execute it as often, and tell what is known of it then."""
        with contextlib.ExitStack() as stack:
            stack.enter_context(logged(self.tell, self.LOGS_TRANSITIONS))
            stack.enter_context(mock.patch.object(visiting, 'monotonic', self.now))
            # nothing settles while a command waits, which comes in the thread of the machine
            stack.enter_context(mock.patch.object(control, '_SETTLE_S', 0.001))
            for _ in range(trials):
                self.lines.append('= {}'.format(self.execute()))
            self.tell('RATES', self.machine.rates())
            self.tell('TRANSITIONS', sorted(self.machine.transition_counts()))
            for record in records_of(self.machine._oracle):
                self.tell('WAYS ' + record.label, record.ways_so_far())


class Operated(Told):
    """A tree whose operator gives commands at random, before its trials and at its events.

    The commands come in the thread of the machine, with its lock free: so they come at the same
    moments each time. What waits is let go in the end.
    """

    def __init__(self, plan: TreePlan) -> None:
        super().__init__(plan)
        self._hand = OperatorHand(self.machine)
        self._chance = random.Random(plan.seed + ' operated')
        nodes = nodes_of(self.machine)
        self._places = [(node.path, label) for node in nodes for label in node.labels()]
        self._left = 0

    def execute(self) -> str:
        self._left = MOST_COMMANDS
        while self._chance.random() < 0.5:
            self._command()
        return super().execute()

    def _tell(self, event: Any) -> None:
        super()._tell(event)
        if event.kind is EventKind.STATE_START and self._chance.random() < 0.4:
            self._command()
        elif event.kind is EventKind.HOLD_START:
            self._held()

    def _held(self) -> None:
        """Give some commands, and let go what waits then."""
        while self._holds() and self._left > 0 and self._chance.random() < 0.8:
            self._command()
        for let_go in (self._hand.resume, self._hand.confirm):
            if self._holds():
                self._say(partial(let_go, by='eva'))

    def _holds(self) -> bool:
        return any(each.held_by for each in self._hand.status().active)

    def _command(self) -> None:
        """Give one command, and tell the reply."""
        self._left -= 1
        if self._left < 0:
            return
        hand, chance = self._hand, self._chance
        path, label = chance.choice(self._places)
        pattern = chance.choice((label, '{}/{}'.format(path, label), '**/' + label, '*', 'NONE'))
        by = chance.choice(('', 'eva'))
        commands: List[Callable[[], str]] = [
            lambda: hand.pause(by),
            lambda: hand.resume(by),
            lambda: hand.step(chance.choice(('', path, 'nowhere')), by),
            lambda: hand.confirm(chance.choice(('', path)), by),
            lambda: hand.set_breakpoint(pattern, by),
            lambda: hand.remove_breakpoint(
                chance.choice((pattern, *hand.status().breakpoints)), by
            ),
            lambda: hand.set_autonomy(
                pattern, chance.choice(('run', 'announce', 'confirm', '', 'alone')), by
            ),
            lambda: hand.go_to(
                chance.choice((path, path, '', 'nowhere')),
                label,
                by,
                chance.random() < 0.5,
                chance.choice(((), ('a', 'b'))),
            ),
        ]
        if chance.random() < 0.04:
            commands = [lambda: hand.preempt(by)]
        self._say(chance.choice(commands))
        self.tell('STATUS', hand.status())

    def _say(self, command: Callable[[], str]) -> None:
        try:
            said = command()
        except OperatorError as refused:
            said = 'refused: {}'.format(refused)
        self.tell('COMMAND', said)


class _Asked(Expert):
    """Answers what is drawn, and tells what it is asked."""

    def __init__(self, told: Told) -> None:
        self._told = told
        self._asked = 0

    def ask(self, question: Any, cancelled: Any, progress: Any) -> Optional[Answer]:
        self._asked += 1
        self._told.tell('QUESTION', question)
        path, label = question.container_path, question.failed_state
        plan = self._told.plan
        chance = random.Random('{} by hand {}'.format(plan.seed, self._asked))
        if question.interfaces and chance.random() < 0.4:
            return Answer(AnswerKind.INTERFACE, interface=question.interfaces[0].name)
        reply = draw_reply(plan, path, label, self._asked, options_of(question))
        return reply and answer_of(reply)

    def run_interface(
        self, offer: Any, question: Any, cancelled: Any, progress: Any
    ) -> Optional[Answer]:
        self._told.tell('INTERFACE', offer)
        if self._asked % 3 == 0:
            return None
        return Answer(AnswerKind.SUPERSEDE, outcome=question.supersede_outcomes[0].outcome)


def plan_of(number: int, shape: Shape = IN_ORDER) -> TreePlan:
    """The plan of a tree. All policies have their turn."""
    names = sorted(POLICIES)
    return draw('pinned {}'.format(number), shape)._replace(policy=names[number % len(names)])


def is_beside(number: int) -> bool:
    """Whether a tree may have Concurrences."""
    return number % 4 == 3


def tell(number: int) -> List[str]:
    """Return what a tree tells in some trials, and what it may do by `prospects_of`."""
    interfaces = {'hand': {'action': 'hand/assist'}}
    plan = plan_of(number, BESIDE if is_beside(number) else IN_ORDER)
    told = Told(plan, **({'interfaces': interfaces} if number % 3 == 0 else {}))
    told.run(TRIALS)
    for each in prospects_of(told.machine):
        told.tell('PROSPECT', each._replace(settings=None))
    return sorted(told.lines) if is_beside(number) else told.lines


def tell_operated(number: int) -> List[str]:
    """Return what a tree and its operator tell in some trials."""
    told = Operated(plan_of(number))
    told.run(TRIALS)
    return told.lines


def tell_killed(number: int, folder: Path) -> List[str]:
    """Return what is in the store of a tree that was killed at one of its moments, and what the
    tree tells when it is begun again.

    One that may have Concurrences is killed as a leaf begins: then all other threads wait.
    """
    beside = is_beside(number)
    plan = plan_of(number, BESIDE if beside else IN_ORDER)
    lines = killed(partial(Told, plan), number, folder, beside)
    return sorted(DRAWN.sub(r'\1', line) for line in lines) if beside else lines


def killed(
    made: Callable[..., Told], number: int, folder: Path, at_leafs: bool = False
) -> List[str]:
    """Return what is stored of a tree that is killed, and told by one that goes on.

    :param made: makes it, with settings.
    :param at_leafs: it is killed as a leaf begins, else at any of its events.
    """
    settings = {
        'checkpoint': str(folder / 'robot.db'),
        'checkpoint_synchronous': 'OFF',
        'checkpoint_wait_s': 60,
        'on_resume': RESUMES[number % len(RESUMES)],
    }

    def run(points: Points, **settings: Any) -> int:
        told = made(**settings)
        if at_leafs:
            told.world.at_entry = points
        else:
            told.machine.events.observers.append(points)
        told.run(1)
        return points.passed

    def resumed() -> List[str]:
        told = made(**settings)
        told.run(2)
        return told.lines

    points = in_a_process(lambda: run(Points(0)))
    first = 1 if at_leafs else 2
    dies_at = random.Random('pinned {} killed'.format(number)).randrange(first, points + 1)
    assert in_a_process(lambda: run(Points(dies_at), **settings)) is None
    stored = _stored(str(folder / 'robot.db'))
    return stored + [line.replace(str(folder), '.') for line in in_a_process(resumed)]


def _stored(path: str) -> List[str]:
    """The moments of the last trial in a store, and what they come to."""
    store = StoreFile(path, 'OFF')
    try:
        (trial,) = store.trials()
        lines = [
            'MOMENT {} {}'.format(each.seq, written(each._replace(at=0)))
            for each in store.moments(trial.number)
        ]
        tree = read_tree(store, trial.number)
        lines += [
            'WHOLE {} {}'.format(name, written(value))
            for name, value in sorted(tree.whole.items())
            if name not in NOT_TOLD
        ]
        lines += [
            'CONTAINER {} {}'.format(name, written(vars(container)))
            for name, container in sorted(tree.containers.items())
        ]
        return lines
    finally:
        store.close()


def written(value: Any) -> str:
    """A value as text, without times, ids and addresses."""
    text = json.dumps(_plain(value), ensure_ascii=False)
    text = '' if text == '{}' else KEY.sub(r'\1: ', text)
    for pattern, name in ((SECONDS, '# s'), (ADDRESS, ''), (ID, '#')):
        text = pattern.sub(name, text)
    return rounded(text)


def _is_told(key: str) -> bool:
    return key not in NOT_TOLD and not key.endswith('_s')


def _plain(value: Any) -> Any:
    """Plain data of a value. What a tuple with names has for nothing is left out."""
    if isinstance(value, enum.Enum):
        return value.name
    if hasattr(value, '_asdict'):
        value = {
            key: each
            for key, each in value._asdict().items()
            if _is_told(key) and each not in ('', None, (), 0) and each == each
        }
    if hasattr(value, 'keys'):
        return {
            str(key): _plain(value[key])
            for key in sorted(value.keys(), key=str)
            if _is_told(str(key))
        }
    if isinstance(value, (set, frozenset)):
        value = sorted(value)
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, str):
        for cut in CUT_AT:
            value = value.split(cut)[0]
        return value
    return value if isinstance(value, (int, float, type(None))) else type(value).__name__


@contextlib.contextmanager
def logged(note: Callable[[str, str], None], transitions: bool = False) -> Iterator[None]:
    """Pass on what the executive logs, not what an engine does. `transitions`: those, too."""

    def noting(name: str) -> Callable[[Any], None]:
        def log(text: Any) -> None:
            if sys._getframe(1).f_globals['__name__'].startswith('smach_oracle'):
                if transitions or not str(text).startswith('State machine transitioning'):
                    note(name[3:].upper(), str(text))

        return log

    loggers = {name: noting(name) for name in ('loginfo', 'logwarn', 'logerr')}
    with mock.patch.multiple(smach, **loggers):
        yield


def digests(lines: List[str]) -> str:
    """A digest of each kind of lines, and the kinds."""
    kinds: Dict[str, Any] = {}
    for line in lines:
        kind = KINDS.get(line.split(maxsplit=1)[0], 'events')
        kinds.setdefault(kind, hashlib.sha256()).update(line.encode() + b'\n')
    return ' '.join('{} {}'.format(kind, kinds[kind].hexdigest()[:10]) for kind in sorted(kinds))


def write(folder: Path, pins: bool) -> None:
    """Write what all trees tell, a file each. `pins`: the digests, too."""
    told = {name_of(number): tell(number) for number in range(TREES)}
    for number in range(OPERATED):
        told[name_of(number, 'operated')] = tell_operated(number)
    for number in range(KILLED):
        with tempfile.TemporaryDirectory() as store:
            told[name_of(number, 'killed')] = tell_killed(number, Path(store))
    write_trees('trees', told, folder, pins)


def write_trees(what: str, told: Dict[str, List[str]], folder: Path, pins: bool) -> None:
    """Write what trees tell to a folder, a file each. `pins`: the digests of each, too."""
    folder.mkdir(exist_ok=True)
    for name, lines in told.items():
        (folder / (name + '.txt')).write_text('\n'.join(lines) + '\n', 'utf-8')
    if pins:
        (FOLDER / (what + '.txt')).write_text(
            ''.join('{} {}\n'.format(name, digests(lines)) for name, lines in told.items()), 'utf-8'
        )


def name_of(number: int, what: str = 'tree') -> str:
    """The name of a tree in the file of digests."""
    return '{}_{:03}'.format(what, number)


if __name__ == '__main__':
    write(Path(sys.argv[1]), '--pin' in sys.argv)
