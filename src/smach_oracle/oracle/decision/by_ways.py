"""Policies that go by ways: they choose from the menu of a failure, and not by a table. Pure.

doc/ways.md says what is on the menu, what a way costs, and which one is taken.
"""

from operator import itemgetter
from typing import Collection, Mapping, Sequence, Tuple

from .failure_rate import FailureClass
from .policy import Action, Baseline, Menu, Situation, draws_of
from .ways import KEEP, ChosenOrder, Prices, Way

Keyed = Sequence[Tuple[str, Way]]  # the ways of a menu, each behind its key

_FIRST_THREE = itemgetter(0, 1, 2)


def action_of(order: Sequence[Way]) -> Action:
    """Return the action of the way that comes first. No way is left: to ask."""
    if not order:
        return Action.ASK
    return Action.REVISIT if order[0].enters_again else Action.STEP_BACK


def keyed_ways(menu: Menu) -> Keyed:
    """Return the ways of a menu, each with its key: that is asked for many times."""
    return [(way.key, way) for way in menu.ways]


def _reached(keyed: Keyed, tried: Collection[str]) -> int:
    return max((way.reach for key, way in keyed if key in tried), default=0)


class Escalating(Baseline):
    """Tries the way first that costs least for its hope, each once in a streak, and then asks.

    doc/ways.md says what a way costs, and when it does not pay. Microreboot escalates, too: it
    starts the smallest part again first, and then larger ones (Candea et al., OSDI 2004).
    """

    name = 'escalating'
    goes_by_ways = True
    userdata = KEEP
    most_of_streak = 4  # ways
    most_of_trial = 8
    most_trials = 3.0  # so many times a usual trial a streak may take
    asking_minutes = 5.0  # of the robot, until a question is answered
    expert_minutes = 2.0  # of the person who answers it
    harm_chance = 1.0 / 30  # of each state that is entered again
    # what is left of the hope that the state succeeds without any other one
    hope = {FailureClass.LOW: 1.0, FailureClass.MODERATE: 0.5, FailureClass.HIGH: 0.25}
    hope_after_each = 0.5  # way of the streak
    parameters: Mapping[str, float] = {'explore': 0.0, 'seed': 0}

    def __init__(self, explore: float = 0.0, seed: float = 0) -> None:
        self.explore = float(explore)
        self.seed = int(seed)
        self.draws = self.explore > 0.0

    def decide(self, situation: Situation) -> Action:
        """Return the action of the way that comes first."""
        return action_of(self.order(situation))

    def may_do(self, situation: Situation) -> Tuple[Action, ...]:
        """Return all of its actions: the menu is known only once a state has failed."""
        return Action.REVISIT, Action.STEP_BACK, Action.ASK

    def price(self, way: Way, prices: Prices) -> float:
        """Return what a way takes, in minutes of the robot."""
        return prices.robot_minute * way.minutes + prices.harm * self.harm_chance * len(way.repeats)

    def cost(self, way: Way, situation: Situation) -> float:
        """Return what a way takes for its hope.

        A longer step back also repeats what a shorter one does. The cause may lie as well between
        one and two states back as between two and four. So a step back has the hope of each
        doubling that no way of the streak has reached.
        """
        keyed = keyed_ways(situation.menu)
        tried = situation.menu.streak.tried
        price = self.price(way, situation.menu.prices)
        return self._for_its_hope(price, way, situation, _reached(keyed, tried))

    def _for_its_hope(self, price: float, way: Way, situation: Situation, reached: int) -> float:
        """Return a price by its hope. `reached`: the farthest reach of the ways that were tried."""
        new = way.reach - reached
        if new > 0:
            return price / new
        hope = self.hope[situation.failure_class] if way.enters_again else 1.0
        return price / (hope * self.hope_after_each ** len(situation.menu.streak.tried))

    def price_of_asking(self, situation: Situation) -> float:
        """Return what it costs to ask, or to lose the trial where there is nobody to ask."""
        prices = situation.menu.prices
        if not situation.menu.has_expert:
            return prices.lost_trial
        return (
            prices.robot_minute * self.asking_minutes + prices.expert_minute * self.expert_minutes
        )

    def order(self, situation: Situation) -> Tuple[Way, ...]:
        """Return the ways that are open, untried and pay. The first costs least for its hope."""
        return self._order_of(situation, keyed_ways(situation.menu))

    def _order_of(self, situation: Situation, keyed: Keyed) -> Tuple[Way, ...]:
        """Return that order. `keyed`: the ways of the menu, by their keys."""
        if self._spent(situation):
            return ()
        limit, prices = self.price_of_asking(situation), situation.menu.prices
        tried = situation.menu.streak.tried
        reached, priced = _reached(keyed, tried), []
        for key, way in keyed:
            price = limit if way.blocked or key in tried else self.price(way, prices)
            if price < limit:
                cost = self._for_its_hope(price, way, situation, reached)
                if cost < limit:
                    priced.append((cost, way.minutes, key, way))
        priced.sort(key=_FIRST_THREE)
        return tuple(each[3] for each in priced)

    def choose(self, situation: Situation) -> ChosenOrder:
        """Return the order of the ways, in which the first two may have changed places."""
        return self._explored(ChosenOrder(self.order(situation)), situation)

    def _explored(self, choice: ChosenOrder, situation: Situation) -> ChosenOrder:
        """Have the first two ways change places, with the chance `explore`.

        A state that is not to be repeated is not among them: a way that repeats it is not open.
        """
        if not self.explore or len(choice.ways) < 2:
            return choice
        first, second, *others = choice.ways
        if draws_of(self.seed, situation.past).random() >= self.explore:
            return choice._replace(chance=1.0 - self.explore)
        return ChosenOrder((second, first, *others), self.explore)

    def chance_of(self, situation: Situation, key: str) -> float:
        """Return the chance with which it goes a way first."""
        first, *others = [way.key for way in self.order(situation)] or ['']
        if not others or key not in (first, others[0]):
            return float(key == first)
        return 1.0 - self.explore if key == first else self.explore

    def _spent(self, situation: Situation) -> str:
        past, streak = situation.past, situation.menu.streak
        if streak.attempts >= self.most_of_streak:
            return '{} attempts have not helped'.format(streak.attempts)
        if past.attempts >= self.most_of_trial:
            return "the trial's {} attempts are spent".format(self.most_of_trial)
        usual = past.usual_minutes
        if usual is not None and streak.minutes > max(self.most_trials * usual, 1.0):
            return 'its attempts take longer than {:g} trials'.format(self.most_trials)
        return ''

    def why(self, situation: Situation) -> str:
        """Say why it asks."""
        spent = self._spent(situation)
        if spent or self.order(situation):
            return spent
        menu = situation.menu
        if all(way.blocked or way.key in menu.streak.tried for way in menu.ways):
            return (
                'no other way is open' if not situation.menu.streak.tried else 'all ways are tried'
            )
        return 'no way is left that costs less than to ask'


class AnyWay(Escalating):
    """Goes the ways that `escalating` would go, in an order that is drawn: its control.

    Each order is as likely. It depends on what a draw of `random` depends on, and on nothing else.
    """

    name = 'any_way'
    parameters: Mapping[str, float] = {'seed': 0}

    def __init__(self, seed: float = 0) -> None:
        super().__init__(seed=seed)
        self.draws = True

    def choose(self, situation: Situation) -> ChosenOrder:
        """Return the drawn order, and the chance of its first way."""
        ways = self.order(situation)
        return ChosenOrder(ways, 1.0 / max(1, len(ways)))

    def order(self, situation: Situation) -> Tuple[Way, ...]:
        """Return the ways that are open, untried and pay, in the order that is drawn."""
        ways = super().order(situation)
        return tuple(draws_of(self.seed, situation.past).sample(ways, len(ways)))

    def chance_of(self, situation: Situation, key: str) -> float:
        """Return the chance with which it goes a way first. Each order is as likely."""
        keys = [way.key for way in super().order(situation)] or ['']
        return 1.0 / len(keys) if key in keys else 0.0
