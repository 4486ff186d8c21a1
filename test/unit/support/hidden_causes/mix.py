"""The mix of causes, as data: how often each property of a hidden world is drawn.

No figure says what cures a failure. A condition has properties, each drawn by itself: who makes it
hold, whether time does, whether a person can, what spoils it. What cures follows from these, from
where the machine stands, and from what was done before. The figures are guesses at a robot at work,
and no measurement of one. They were set by the shares of failing trials and of false successes that
they lead to, before there was a policy with a list of ways. A change of them makes other machines.
"""

from typing import Dict, NamedTuple, Tuple


class Mix(NamedTuple):
    """The chances and ranges by which the causes of a machine are drawn."""

    # -- how often something goes wrong
    amount: Tuple[float, float] = (0.1, 0.8)  # disturbances of a trial, by machine
    again: float = 0.3  # of that chance is left at later executions of a state in a trial
    disturbances: float = 0.8  # for each condition
    breaks_two: float = 0.25  # disturbances that break a second condition, too
    noise: float = 0.0075  # an execution fails for no reason that stays; by state, up to twice this
    drifts: Dict[str, float] = {
        'steady': 0.5, 'rising': 0.15, 'falling': 0.15, 'step': 0.1, 'wave': 0.1,
    }  # fmt: skip

    # -- how much machines differ: a chance, or what it lacks to 1, varies by machine by this share
    varies: float = 0.8

    # -- what a state makes, for one that comes later
    used: float = 0.75  # products that a later state needs
    used_twice: float = 0.25  # of these, by a second one
    nearer: float = 0.45  # a later state is this one, else one further on
    goal: float = 0.5  # products that the goal needs, besides all that no state needs
    used_up: float = 0.15  # products that the state which needs them uses up
    sure: float = 0.9  # states that always make what they make
    unsure: Tuple[float, float] = (0.8, 0.99)  # the chance of the others
    once: float = 0.1  # states that harm something if they do again what is done

    # -- what no state makes: light, people, a network, a part of the robot
    around: float = 0.6  # for each state of the chain
    seen_to: float = 0.2  # of these, conditions that some state sees to by the way

    # -- what else makes it hold
    heals: Dict[str, float] = {'product': 0.15, 'around': 0.6}
    heals_s: Tuple[float, float] = (2.0, 600.0)  # mean time until then
    fades: float = 0.08  # products that do not last
    fades_s: Tuple[float, float] = (300.0, 3600.0)
    by_hand: Dict[str, float] = {'product': 0.9, 'around': 0.8}  # a person can
    variants: float = 0.12  # another way of doing the work manages without it
    most_variants: int = 3

    # -- what makes it worse: the state that needs it tries although it does not hold
    worsens: float = 0.2
    worse: Tuple[float, float] = (0.1, 0.6)  # the chance of that, each time
    what_worsens: Dict[str, float] = {
        'harm': 0.4, 'only by hand': 0.3, 'for good': 0.1, 'spreads': 0.2,
    }  # fmt: skip

    # -- what is seen of it
    noticed: Dict[float, float] = {1.0: 0.90, 0.8: 0.07, 0.3: 0.03}
    misnamed: Dict[float, float] = {0.0: 0.5, 0.2: 0.3, 0.6: 0.2}
    raises: float = 0.85  # states without a failing outcome that raise. The others say success

    # -- the userdata
    lists: float = 0.25  # machines in which a state appends to a list that a later one reads
    in_place: float = 0.5  # of these lists, those that are changed in place
    double_harms: float = 0.5  # what is in the list twice harms. Else the work is spoiled

    # -- time
    takes_s: Tuple[float, float] = (3.0, 90.0)  # median of a state
    spread: float = 0.3  # of its logarithm
    loops: float = 0.15  # an execution of a state that may lead back leads back, twice at most
    patience_s: float = 3600.0  # a trial that has not ended then is cut off

    # -- the person
    arrival_s: float = 180.0  # until the person is there, in which the robot waits
    look_s: float = 120.0
    act_s: float = 180.0  # to make a condition hold by hand
    longest_wait_s: float = 1200.0  # for what heals by itself
    most_questions: int = 6  # of a trial, before the person gives up
    times_alike: int = 2  # questions about one state, before the person does its work


MIX = Mix()
