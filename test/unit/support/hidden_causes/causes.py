"""The hidden world of a machine, drawn by a mix from its seed."""

from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from .chance import Chance
from .mix import Mix
from .plan import ITERATED, Box, Leaf, boxes_of, leaves_of
from .world import SPREADS, Causes, Condition, Disturbance, Work


class Place(NamedTuple):
    """A state in the order in which a machine that meets no failure comes to it."""

    leaf: Leaf
    comes_once: bool  # in a trial without failures


class _List(NamedTuple):
    """A list in the userdata."""

    key: str
    filled_by: str
    read_by: str
    in_place: bool


def draw_causes(seed: object, box: Box, mix: Mix) -> Causes:
    """The world of that seed. A machine that nothing disturbs does all of its work."""
    return _Drawing(seed, box, mix).causes()


def places_of(box: Box) -> List[Place]:
    """All states that the first work outcomes lead to, in order."""
    again = [
        each.path + '/'
        for each in boxes_of(box)
        if each.kind == ITERATED or any(loop_of(leaf, each) for leaf in each.children)
    ]
    return [
        Place(leaf, not any(leaf.path.startswith(path) for path in again))
        for leaf in leaves_of(box)
        if not leaf.is_aside
    ]


def loop_of(leaf: object, around: Box) -> str:
    """The outcome of work by which a state leads back in its container, '' for none."""
    if not isinstance(leaf, Leaf) or leaf.is_aside:
        return ''
    labels = [child.label for child in around.children]
    earlier = labels[: labels.index(leaf.label) + 1]
    return next((name for name in leaf.work[1:] if leaf.leads.get(name) in earlier), '')


class _Drawing:
    def __init__(self, seed: object, box: Box, mix: Mix) -> None:
        self._seed = seed
        self._mix = mix
        self._chance = Chance('causes', seed)
        self._box = box
        self._places = places_of(box)
        self._needs: Dict[str, List[str]] = {leaf.path: [] for leaf in leaves_of(box)}
        self._conditions: Dict[str, Condition] = {}
        self._heals = {kind: self._own(share) for kind, share in mix.heals.items()}
        self._by_hand = {kind: self._own(share) for kind, share in mix.by_hand.items()}
        self._worsens = self._own(mix.worsens)
        self._used_up = self._own(mix.used_up)
        self._variants = self._own(mix.variants)
        self._breaks_two = self._own(mix.breaks_two)
        self._noise = self._own(mix.noise)

    def _own(self, chance: float) -> float:
        """The chance of this machine: machines differ, and have the mix's on the average."""
        factor = self._chance.between(1.0 - self._mix.varies, 1.0 + self._mix.varies)
        return chance * factor if chance <= 0.5 else 1.0 - (1.0 - chance) * factor

    def causes(self) -> Causes:
        for number in range(len(self._places)):
            self._product(number)
        for _ in range(1 + int(self._mix.around * len(self._places))):
            self._around()
        self._spread()
        disturbances = self._disturbances()
        kept = self._list()
        works = {leaf.path: self._work(leaf, kept) for leaf in leaves_of(self._box)}
        return Causes(self._seed, self._conditions, disturbances, works)

    # -- conditions

    def _product(self, number: int) -> None:
        """What a state of the chain makes, for later ones or for the goal."""
        chance, mix, place = self._chance, self._mix, self._places[number]
        users = self._users(number)
        is_goal = not users or chance.happens(mix.goal)
        name = 'c{}'.format(len(self._conditions) + 1)
        used_up = ''
        if users and place.comes_once and users[-1].comes_once and chance.happens(self._used_up):
            used_up, is_goal = users[-1].leaf.path, False
        sure = chance.happens(mix.sure)
        made = 1.0 if sure else chance.between(*mix.unsure)
        fades = not is_goal and chance.happens(mix.fades)
        self._conditions[name] = self._with_chances(
            Condition(
                name,
                {place.leaf.path: made},
                is_goal=is_goal,
                used_up_by=used_up,
                fades_s=chance.magnitude(*mix.fades_s) if fades else None,
            ),
            'product',
        )
        for user in users:
            self._needs[user.leaf.path].append(name)

    def _users(self, number: int) -> List[Place]:
        """The later states that need what a state makes."""
        chance, mix, users = self._chance, self._mix, []
        if chance.happens(mix.used):
            at = number + chance.steps(mix.nearer)
            if at < len(self._places):
                users.append(self._places[at])
                later = self._places[at + 1 :]
                if later and chance.happens(mix.used_twice):
                    users.append(chance.one_of(later))
        return users

    def _around(self) -> None:
        """What holds at first, and what no state is there to make."""
        chance, mix = self._chance, self._mix
        user = chance.one_of(self._places)
        name = 'c{}'.format(len(self._conditions) + 1)
        makers: Dict[str, float] = {}
        if chance.happens(mix.seen_to):
            maker = self._maker_before(user)
            if maker is not None:
                makers[maker.path] = chance.between(*mix.unsure)
        self._conditions[name] = self._with_chances(
            Condition(name, makers, holds_at_first=True), 'around'
        )
        self._needs[user.leaf.path].append(name)

    def _maker_before(self, user: Place) -> Optional[Leaf]:
        """The state aside of the chain that the author leads to, else an earlier one."""
        every = list(leaves_of(self._box))
        at = every.index(user.leaf)
        if at + 1 < len(every) and every[at + 1].is_aside:
            return every[at + 1]
        earlier = [each for each in every[:at] if not each.is_aside]
        return self._chance.one_of(earlier) if earlier else None

    def _with_chances(self, condition: Condition, kind: str) -> Condition:
        """What everything else that can be about a condition is drawn for."""
        chance, mix = self._chance, self._mix
        heals = chance.happens(self._heals[kind])
        worse = chance.happens(self._worsens)
        return condition._replace(
            heals_s=chance.magnitude(*mix.heals_s) if heals else None,
            is_by_hand=chance.happens(self._by_hand[kind]),
            variant=1 + int(chance.draw() * mix.most_variants)
            if chance.happens(self._variants)
            else 0,
            worse=chance.between(*mix.worse) if worse else 0.0,
            worsens=chance.by_weight(mix.what_worsens),
            noticed=chance.by_weight(mix.noticed),
            misnamed=chance.by_weight(mix.misnamed),
        )

    def _spread(self) -> None:
        names = list(self._conditions)
        for name, each in self._conditions.items():
            if each.worsens == SPREADS:
                other = self._chance.one_of(names)
                self._conditions[name] = each._replace(spreads_to=other)

    # -- disturbances

    def _disturbances(self) -> Sequence[Disturbance]:
        chance, mix = self._chance, self._mix
        drawn: List[Tuple[float, Disturbance]] = []
        in_need = [place.leaf.path for place in self._places if self._needs[place.leaf.path]]
        for _ in range(1 + int(mix.disturbances * len(self._conditions))):
            before = chance.one_of(in_need)
            first = chance.one_of(self._needs[before])
            breaks = (first,)
            if chance.happens(self._breaks_two):
                breaks += (chance.one_of(self._behind(first)),)
            drawn.append(
                (
                    chance.draw() ** 2,
                    Disturbance(
                        'd{}'.format(len(drawn) + 1),
                        before,
                        0.0,
                        tuple(dict.fromkeys(breaks)),
                        chance.by_weight(mix.drifts),
                    ),
                )
            )
        amount = chance.magnitude(*mix.amount)
        total = sum(weight for weight, _ in drawn)
        return [each._replace(chance=amount * weight / total) for weight, each in drawn]

    def _behind(self, name: str) -> List[str]:
        """The conditions that those who make one need, else any."""
        makers = self._conditions[name].makers
        return [each for path in makers for each in self._needs[path]] or list(self._conditions)

    # -- states

    def _list(self) -> Optional[_List]:
        once = [place.leaf for place in self._places if place.comes_once]
        if len(once) < 2 or not self._chance.happens(self._mix.lists):
            return None
        filled = int(self._chance.draw() * (len(once) - 1))
        reader = self._chance.one_of(once[filled + 1 :])
        in_place = self._chance.happens(self._mix.in_place)
        return _List('seen', once[filled].path, reader.path, in_place)

    def _work(self, leaf: Leaf, kept: Optional[_List]) -> Work:
        chance, mix = self._chance, self._mix
        comes_once = any(place.leaf == leaf and place.comes_once for place in self._places)
        fills = kept is not None and kept.filled_by == leaf.path
        reads = kept is not None and kept.read_by == leaf.path
        return Work(
            tuple(dict.fromkeys(self._needs[leaf.path])),
            takes_s=chance.magnitude(*mix.takes_s),
            noise=2.0 * self._noise * chance.draw(),
            is_once=comes_once and chance.happens(mix.once),
            can_fail=bool(leaf.failing) or chance.happens(mix.raises),
            appends_to=kept.key if kept and fills else '',
            in_place=bool(kept and fills and kept.in_place),
            reads=kept.key if kept and reads else '',
        )
