"""A stand-in for a person who knows the cause of a failure, and acts."""

import collections
import threading
from typing import Counter, List, NamedTuple, Optional, Sequence, Tuple

from smach_oracle.oracle import Answer, AnswerKind, Expert, Question

from .mix import Mix
from .plan import DONE, Box, leaves_of
from .world import Condition, World

SOON_S = 120.0


class Remedy(NamedTuple):
    """What cures a failure: all of it is needed."""

    enter: Tuple[str, ...] = ()  # paths of states that make what lacks
    mend: Tuple[str, ...] = ()  # by hand
    wait_s: float = 0.0
    is_hopeless: bool = False

    def with_more(self, other: 'Remedy') -> 'Remedy':
        """Return both."""
        return Remedy(
            self.enter + other.enter,
            self.mend + other.mend,
            max(self.wait_s, other.wait_s),
            self.is_hopeless or other.is_hopeless,
        )


class Person(Expert):
    """Looks at the world, mends what a hand can mend, and says where the machine goes on.

    The person sends the machine back to the state that makes what lacks, and waits for what heals
    soon. Where nothing helps the person gives up. After some questions about one state the person
    does its work by hand. All of it takes minutes, in which the robot stands.
    """

    def __init__(self, world: World, box: Box, mix: Mix) -> None:
        self._world = world
        self._mix = mix
        self._order = [leaf.path for leaf in leaves_of(box)]
        self._aside = {leaf.path for leaf in leaves_of(box) if leaf.is_aside}
        self.begin()

    def begin(self) -> None:
        """Begin a trial."""
        self.questions = 0
        self._alike: Counter[str] = collections.Counter()

    def ask(
        self, question: Question, cancelled: threading.Event, progress: object
    ) -> Optional[Answer]:
        """Come, look, and help."""
        world, mix = self._world, self._mix
        world.clock.advance(mix.arrival_s)
        self._spend(mix.look_s)
        self.questions += 1
        path = world.last_failed
        self._alike[path] += 1
        if self.questions > mix.most_questions:
            return _give_up()
        if self._alike[path] > mix.times_alike:
            return self._do_work(question, path)
        remedy = self.remedy_of(path)
        if remedy.is_hopeless:
            return _give_up()
        for name in dict.fromkeys(remedy.mend):
            self._spend(mix.act_s)
            world.mend(name)
        self._spend(remedy.wait_s)
        target = min(remedy.enter or (path,), key=self._order.index)
        return self._go_to(question, target) or self._do_work(question, path)

    def remedy_of(self, path: str, behind: Sequence[str] = ()) -> Remedy:
        """Return what cures a failure of a state."""
        remedy = Remedy()
        for condition in self._world.lacking(path):
            remedy = remedy.with_more(self._cure(condition, (*behind, path)))
        return remedy

    def _cure(self, condition: Condition, behind: Sequence[str]) -> Remedy:
        world, name = self._world, condition.name
        heals_s = world.heals_in_s(name)
        if heals_s is not None and heals_s <= SOON_S:
            return Remedy(wait_s=heals_s)
        makers = [
            each for each in world.remade_by(name) if each not in behind and each not in self._aside
        ]
        for maker in makers:
            remedy = self.remedy_of(maker, behind)
            if not remedy.is_hopeless:
                return remedy.with_more(Remedy(enter=(maker,)))
        if world.can_mend(name):
            return Remedy(mend=(name,))
        if heals_s is not None and heals_s <= self._mix.longest_wait_s:
            return Remedy(wait_s=heals_s)
        return Remedy(is_hopeless=True)

    def _go_to(self, question: Question, path: str) -> Optional[Answer]:
        """Send the machine to a state, where it can go there."""
        container, label = path.rsplit('/', 1)
        for choice in question.choices:
            if (choice.container or question.container_path, choice.state) == (container, label):
                if choice.blocked:
                    return None
                return Answer(AnswerKind.GOTO, state=label, container=choice.container, by='person')
        return None

    def _do_work(self, question: Question, path: str) -> Answer:
        """Do the work of a state by hand, and what lacks for it."""
        world = self._world
        is_asked = path == '{}/{}'.format(question.container_path, question.failed_state)
        offered: List[object] = [each.outcome for each in question.supersede_outcomes]
        lacking = [each.name for each in world.lacking(path)]
        products = [name for name, each in world.causes.conditions.items() if path in each.makers]
        if not is_asked or DONE not in offered or not all(map(world.can_mend, products)):
            return _give_up()
        self._spend(self._mix.act_s * (1 + len(lacking)))
        for name in filter(world.can_mend, lacking):
            world.mend(name)
        world.do_by_hand(path)
        return Answer(AnswerKind.SUPERSEDE, outcome=DONE, by='person')

    def _spend(self, seconds: float) -> None:
        self._world.clock.advance(seconds)
        self._world.expert_s += seconds


def _give_up() -> Answer:
    return Answer(AnswerKind.GIVE_UP, by='person')
