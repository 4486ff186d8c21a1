"""Trees drawn at random under circumstances that are drawn, too. test/data/pinned/circumstances.txt
has the digests of what they tell.

    python3 test/unit/support/pinned_circumstances.py FOLDER [--pin]

does for these trees what pinned_trees.py does for its own. Here time passes, the robot may be
unwell, many more settings are drawn, and preconditions and experts may do what they should not.
"""

import random
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Tuple
from unittest import mock

HERE = Path(__file__).resolve().parent
if __name__ == '__main__':
    sys.path[:0] = [str(HERE), str(HERE.parents[2] / 'src')]

from pinned_trees import Told, killed, name_of, plan_of, write_trees
from tree_model.plan import machines_of

from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.asking.question import Answer, AnswerKind, Expert
from smach_oracle.oracle.errors import AnswerError, InterfaceError
from smach_oracle.oracle.machine import health_watch
from smach_oracle.oracle.machine.oracle import oracle_of
from smach_oracle.oracle.prospects import prospects_of

TREES, KILLED = 80, 40
FIRST = 1000  # other plans than those of pinned_trees.py
TRIALS = 4
UNWELL_EVERY_S = (20.0, 90.0, 400.0)


class Circumstances(Told):
    """A tree, and what is drawn around it."""

    def __init__(self, number: int, **settings: Any) -> None:
        plan = plan_of(FIRST + number)
        self._drawn = random.Random(plan.seed + ' circumstances')
        self._is_unwell_after_s = self._drawn.choice(UNWELL_EVERY_S)
        super().__init__(plan, **settings)
        self._clock: Any = oracle_of(self.machine).clock
        self.world.at_entry = self._takes_time

    def now(self) -> float:
        return self._clock.now()

    def run(self, trials: int) -> None:
        looks = random.Random(self.plan.seed + ' looks')
        with mock.patch.object(health_watch, 'random', looks):
            super().run(trials - trials // 2)
            if trials > 1 and self._drawn.random() < 0.3:
                OracleContainer.wrap(self.machine, settings=self._changed())
            super().run(trials // 2)
        for each in prospects_of(self.machine):
            self.tell('PROSPECT', each._replace(settings=None))

    def _changed(self) -> Dict[str, Any]:
        """Other settings, from now on."""
        settings = dict(self.settings(), memory=self._drawn.choice((1, 3, 20)))
        settings.update(prior=0.2, estimator=self._drawn.choice(('window', 'exponential')))
        return settings

    def execute(self) -> str:
        if self._drawn.random() < 0.2:
            label = self._drawn.choice([node.label for node in self.plan.top.children])
            self.machine.set_initial_state([label])
        return super().execute()

    def _takes_time(self) -> None:
        self._clock.advance(self._drawn.choice((0.0, 0.0, 0.5, 4.0, 30.0)))

    def _why_unwell(self) -> Any:
        """Some minutes are bad."""
        since_s = self._clock.now() % (2 * self._is_unwell_after_s) - self._is_unwell_after_s
        if since_s < 0 or since_s > 6:
            return True
        if since_s > 4:
            raise RuntimeError('no battery')
        return False if since_s > 3 else 'it stands still'

    def settings(self) -> Dict[str, Any]:
        settings, drawn = super().settings(), self._drawn
        chance = drawn.random

        def some(share: float, **more: Any) -> None:
            if chance() < share:
                settings.update(more)

        healthy = {'function': self._why_unwell, 'name': 'battery'}
        some(0.4, healthy={'settle_s': drawn.choice((0, 0.5, 3)), 'conditions': [healthy]})
        if chance() < 0.4:
            settings['budget']['minutes'] = drawn.choice((0.5, 1, 3, 10))
        some(0.2, failing_outcomes=drawn.choice((['odd'], ['aborted', 'failed'], ['preempted'])))
        some(0.3, moderate_from=drawn.choice((0.1, 0.3)), high_from=drawn.choice((0.5, 0.95)))
        some(0.4, interfaces=self._interfaces())
        some(0.3, cost={'harm': drawn.choice((0, 5)), 'expert_minute': drawn.choice((0.1, 50))})
        some(0.3, deep_copy_keys=['a', 'c'])
        expert = {
            'history_length': drawn.choice((1, 2, 50)),
            'watch_preconditions': False,
            'deadline_s': drawn.choice((0, 20)),
            'on_no_answer': settings.pop('on_no_answer'),
        }
        some(1, expert=expert, still_running={'after_s': 0})  # in a thread that asks whenever
        tree = {
            'escalate': settings.pop('escalate'),
            'step_back_across': chance() < 0.5,
        }
        some(1, tree=tree)
        if chance() < 0.4:
            del settings['userdata']
        for own in settings['states'].values():
            if chance() < 0.3:
                own['time_limit_s'] = 1e6
            if chance() < 0.1:
                own['autonomy'] = 'announce'
        return settings

    def _interfaces(self) -> Dict[str, Any]:
        """One for all states, and one for some."""
        labels = [node.label for _, top in machines_of(self.plan) for node in top.children]
        some = self._drawn.sample(sorted(set(labels)), min(2, len(set(labels))))
        return {
            'hand': {'action': 'hand/assist', 'description': 'the arm is driven'},
            'eye': {'action': 'eye/mark', 'states': some},
        }

    def expert(self) -> Optional[Expert]:
        asked = super().expert()
        return asked and _Odd(asked, random.Random(self.plan.seed + ' odd'))

    def _checks(self) -> Dict[str, List[Any]]:
        return {
            name: [check if isinstance(check, str) else self._odd(check) for check in checks]
            for name, checks in super()._checks().items()
        }

    def _odd(self, check: Any) -> Any:
        """The same precondition, which now and then says what it should not."""
        drawn = random.Random('{} {}'.format(self.plan.seed, check.__name__))

        def checked(ud: Any) -> Any:
            chance = drawn.random()
            if chance < 0.08:
                raise KeyError('no such object')
            return check(ud) if chance < 0.8 else drawn.choice((None, 1, '', 'yes', []))

        checked.__name__ = check.__name__
        return checked


class _Odd(Expert):
    """An expert who answers now and then what cannot be done."""

    def __init__(self, asked: Expert, drawn: random.Random) -> None:
        self._asked = asked
        self._drawn = drawn

    def ask(self, question: Any, cancelled: Any, progress: Any) -> Any:
        answer = self._asked.ask(question, cancelled, progress)
        chance = self._drawn.random()
        if chance < 0.06:
            raise AnswerError('it speaks another language')
        if chance < 0.1:
            raise RuntimeError('no light')
        if chance < 0.25:
            return self._drawn.choice(
                (
                    Answer(AnswerKind.GOTO, state='NOWHERE'),
                    Answer(AnswerKind.GOTO, state=question.failed_state, container='T/NOWHERE'),
                    Answer(AnswerKind.SUPERSEDE, outcome='strange'),
                    Answer(AnswerKind.SUPERSEDE, outcome='ok', outputs={'strange': 1}),
                    Answer(AnswerKind.GIVE_UP, outcome='strange'),
                    Answer(AnswerKind.INTERFACE, interface='strange'),
                    'anything',
                )
            )
        if chance < 0.4:
            progress('claimed', 'eva', 'she looks')
            return answer and answer._replace(by='eva', why='she saw it')
        return answer

    def run_interface(self, offer: Any, question: Any, cancelled: Any, progress: Any) -> Any:
        if self._drawn.random() < 0.2:
            raise InterfaceError('no hand')
        return self._asked.run_interface(offer, question, cancelled, progress)


def tell(number: int, folder: Path) -> List[str]:
    """Return what a tree tells in some trials, and what it may do by `prospects_of`.

    Every fourth keeps its rates in a file in a folder, and is made again.
    """
    is_kept = number % 4 == 0
    settings = {'rates_file': str(folder / 'rates.yaml')} if is_kept else {}
    lines = []
    for _ in range(1 + is_kept):
        told = Circumstances(number, **settings)
        told.run(TRIALS // (1 + is_kept))
        lines += told.lines
    return [line.replace(str(folder), '.') for line in lines]


def tell_killed(number: int, folder: Path) -> List[str]:
    """Return what is stored of such a tree that is killed, and told by one that goes on."""
    return killed(partial(Circumstances, number), number, folder)


def all_told() -> Iterator[Tuple[str, List[str]]]:
    """Yield the name of each tree, and what it tells."""
    for what, trees, telling in (('tree', TREES, tell), ('killed', KILLED, tell_killed)):
        for number in range(trees):
            with tempfile.TemporaryDirectory() as folder:
                yield name_of(number, what), telling(number, Path(folder))


def write(folder: Path, pins: bool) -> None:
    """Write what all trees tell, a file each. `pins`: the digests, too."""
    write_trees('circumstances', dict(all_told()), folder, pins)


if __name__ == '__main__':
    write(Path(sys.argv[1]), '--pin' in sys.argv)
