"""The protocol's experiments: several parts, each an experiment with a folder of its own."""

from typing import Callable, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from .freeze import BLOCKS
from .plan import BARE, DEFAULT, ONE_LINE, TASKS, ExperimentPlan, Variant, named_variants

COMPARED = (BARE, DEFAULT, 'restart')  # variants with all replicates, and at all shares
# with one. They are the policies of then: a later one is judged by a protocol of its own
OTHERS = ('algorithm1', 'always_ask', 'ladder', 'random', 'retry', 'step_back')
REPLICATES = {'pick_and_place': 3, 'drink_retrieval': 4}
SWEPT = {'pick_and_place': 100, 'drink_retrieval': 60}  # trials of a point of a sweep
MEMORIES = (2, 5, 10, 20, 50)
SHARES = (0.0, 0.5, 1.0)  # of the causes, that last
HOURS = {'pick_and_place': 20.0, 'drink_retrieval': 16.0}  # of continuous operation
ALL = 'all'  # of the protocol that the fourth freeze holds
# of the fifth freeze: doc/protocol.md says why these
JUDGED = (
    BARE,
    'restart',
    DEFAULT,
    *(ONE_LINE + name for name in ('escalating', 'learned', 'any_way')),
)
BESIDE = (ONE_LINE + 'prose', 'ladder', 'escalating', 'learned')  # with one replicate
EXTENDED = (BARE, DEFAULT, ONE_LINE + 'escalating', ONE_LINE + 'learned')
GOING_ON = (DEFAULT, ONE_LINE + 'escalating', ONE_LINE + 'learned')  # in continuous operation
# of the inspection robot, and further ones for which its folder of the fifth freeze has no room
TOURED = EXTENDED
MORE_TOURS = 140
# replicates, and trials of each: with those of JUDGED they are 1,100 pairs
EXTENSION = {'pick_and_place': (5, 130), 'drink_retrieval': (7, 100)}
# with the extra kinds of causes: trials, in one replicate
UNFORESEEN = (BARE, 'restart', DEFAULT, ONE_LINE + 'escalating', ONE_LINE + 'learned')
EXTRA = {'pick_and_place': 40, 'drink_retrieval': 30, 'inspection': 20}
BLOCK_OF = dict(
    zip(
        (
            'pick_and_place',
            'drink_retrieval',
            'persistence',
            'memory',
            'continuous',
            'pick_and_place_extension',
            'drink_retrieval_extension',
            'inspection',
            'pick_and_place_extra',
            'drink_retrieval_extra',
            'inspection_extra',
        ),
        BLOCKS,
    )
)


class Part(NamedTuple):
    """One part. Its name is that of its folder below the protocol's."""

    name: str
    plan: ExperimentPlan


class ProtocolChoice(NamedTuple):
    """The part of a protocol that is run, and its seeds."""

    seeds: Mapping[str, int]  # the first of each of BLOCKS
    answer_delay: float  # s
    variants: Tuple[str, ...] = ()  # in place of those of the protocol
    tasks: Tuple[str, ...] = tuple(sorted(TASKS))
    trials: Optional[int] = None  # of a replicate, at most
    replicates: Optional[int] = None  # at most

    @property
    def lock_step(self) -> Tuple[str, ...]:
        """Return those of the tasks whose worlds are in lock-step."""
        return tuple(task for task in self.tasks if TASKS[task].lock_step)

    @property
    def paced(self) -> Tuple[str, ...]:
        """Return the others, whose worlds have a pace of their own."""
        return tuple(task for task in self.tasks if not TASKS[task].lock_step)

    def part(
        self,
        name: str,
        task: str,
        trials: int,
        replicates: int,
        variants: Sequence[Variant],
        lasting: Optional[float] = None,
        hours: Optional[float] = None,
        fifth: bool = False,
        extra: bool = False,
        behind: int = 0,
    ) -> Part:
        """Return a part of so many trials and replicates at most.

        Where fewer trials are run, a world that goes on does so for fewer hours.

        :param name: of the figure.
        :param fifth: it is of the fifth freeze, whose trials are shared where nothing fails.
        :param extra: its trials have the extra kinds of causes. These are not shared.
        :param behind: seeds of its block that other parts have before it.
        """
        fewer = min(trials, self.trials or trials)
        if hours is not None:
            hours *= fewer / trials
        block = BLOCK_OF.get('{}_{}'.format(task, name), BLOCK_OF.get(name, BLOCK_OF[task]))
        seed = self.seeds[block] + behind
        told = '' if lasting is None else '_{:.0f}'.format(100 * lasting)
        return Part(
            '{}_{}{}{}'.format(task, 'fifth_' if fifth else '', name, told),
            ExperimentPlan(
                task,
                fewer,
                seed,
                min(replicates, self.replicates or replicates),
                tuple(variants),
                self.answer_delay,
                lasting=lasting,
                hours=hours,
                shares=fifth and hours is None and not extra and TASKS[task].lock_step,
                extra_causes=extra,
            ),
        )


def main_parts(choice: ProtocolChoice) -> Iterator[Part]:
    """Yield the main table's parts: the compared variants, and the others in one replicate."""
    for task in choice.lock_step:
        trials = TASKS[task].trials
        yield choice.part(
            'compared',
            task,
            trials,
            REPLICATES[task],
            named_variants(choice.variants or COMPARED, {}),
        )
        if not choice.variants:
            yield choice.part('others', task, trials, 1, named_variants(OTHERS, {}))


def persistence_parts(choice: ProtocolChoice) -> Iterator[Part]:
    """Yield a part for each share of causes that last."""
    for task in choice.lock_step:
        for share in SHARES:
            yield choice.part(
                'persistence',
                task,
                SWEPT[task],
                1,
                named_variants(choice.variants or COMPARED, {}),
                lasting=share,
            )


def memory_parts(choice: ProtocolChoice) -> Iterator[Part]:
    """Yield a part with a variant for each memory."""
    for task in choice.lock_step:
        yield choice.part(
            'memory',
            task,
            SWEPT[task],
            1,
            named_variants(choice.variants or (DEFAULT,), {}, MEMORIES),
        )


def continuous_parts(choice: ProtocolChoice) -> Iterator[Part]:
    """Yield the parts of continuous operation."""
    for task in choice.lock_step:
        yield choice.part(
            'continuous',
            task,
            TASKS[task].trials,
            1,
            named_variants(choice.variants or (DEFAULT,), {}),
            hours=HOURS[task],
        )


def fifth_parts(choice: ProtocolChoice) -> Iterator[Part]:
    """Yield the parts of the fifth freeze, without its extension."""
    for task in choice.lock_step:
        trials, all_of = TASKS[task].trials, choice.variants
        yield choice.part(
            'compared',
            task,
            trials,
            REPLICATES[task],
            named_variants(all_of or JUDGED, {}),
            fifth=True,
        )
        if not all_of:
            yield choice.part('others', task, trials, 1, named_variants(BESIDE, {}), fifth=True)
        yield choice.part(
            'continuous',
            task,
            trials,
            1,
            named_variants(all_of or GOING_ON, {}),
            hours=HOURS[task],
            fifth=True,
        )
        yield _unforeseen(choice, task, UNFORESEEN)
    yield from _tours(choice, 'compared')
    for task in choice.paced:
        yield _unforeseen(choice, task, TOURED)


def _unforeseen(choice: ProtocolChoice, task: str, variants: Sequence[str]) -> Part:
    """Return the part of a task with the extra kinds of causes. It decides no hypothesis."""
    return choice.part(
        'extra',
        task,
        EXTRA[task],
        1,
        named_variants(choice.variants or variants, {}),
        fifth=True,
        extra=True,
    )


def _tours(choice: ProtocolChoice, name: str, more: int = 0) -> Iterator[Part]:
    """Yield a part of each world that has a pace of its own. It decides no hypothesis.

    :param more: tours behind the default number. 0 means the default number of them.
    """
    for task in choice.paced:
        usual = TASKS[task].trials
        yield choice.part(
            name,
            task,
            more or usual,
            1,
            named_variants(choice.variants or TOURED, {}),
            fifth=True,
            behind=usual if more else 0,
        )


def extension_parts(choice: ProtocolChoice) -> Iterator[Part]:
    """Yield the parts of the one extension of the fifth freeze, and further tours."""
    for task in choice.lock_step:
        replicates, trials = EXTENSION[task]
        yield choice.part(
            'extension',
            task,
            trials,
            replicates,
            named_variants(choice.variants or EXTENDED, {}),
            fifth=True,
        )
    yield from _tours(choice, 'more', MORE_TOURS)


PROTOCOLS: Dict[str, Callable[[ProtocolChoice], Iterator[Part]]] = {
    'main': main_parts,
    'persistence': persistence_parts,
    'memory': memory_parts,
    'continuous': continuous_parts,
    'fifth': fifth_parts,
    'fifth_extension': extension_parts,
}
FOURTH = ('main', 'persistence', 'memory', 'continuous')


def parts_of(protocol: str, choice: ProtocolChoice) -> List[Part]:
    """Return the parts of a protocol, or of ALL of them.

    :raises KeyError: for one that is not there.
    """
    names = FOURTH if protocol == ALL else (protocol,)
    return [part for name in names for part in PROTOCOLS[name](choice)]
