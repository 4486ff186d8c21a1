"""The limits of a disk, and the trials that go: the oldest that have ended. Pure."""

from typing import Dict, Iterable, List, NamedTuple, Sequence

DAY_S = 86400.0
GB = 1e9


class Limits(NamedTuple):
    """The amount that is kept. 0 means no limit."""

    days: float = 0.0  # since the newest bag of a trial was closed
    gb: float = 0.0  # 10^9 bytes, of all bags of a folder

    @property
    def are_set(self) -> bool:
        """Whether anything may go."""
        return bool(self.days or self.gb)


NO_LIMITS = Limits()


class KnownBag(NamedTuple):
    """A bag as far as pruning goes by it."""

    path: str
    size: int  # bytes
    closed_at: float  # s since the epoch
    trials: Sequence[str]  # ids
    ended: Sequence[str]  # ids of those whose end is in it, with no question open
    why_kept: str = ''  # '': it may go


class Removal(NamedTuple):
    """A bag that goes."""

    bag: KnownBag
    why: str


class Plan(NamedTuple):
    """The trials that go, the oldest first, and those that stay although a limit is exceeded."""

    removals: List[Removal]
    kept: List[Removal]


def planned(bags: Iterable[KnownBag], limits: Limits, now: float) -> Plan:
    """Return what goes.

    All bags of a trial go together, so that whole trials remain.

    :param now: s since the epoch.
    """
    groups = sorted(_groups(list(bags)), key=lambda group: max(bag.closed_at for bag in group))
    left = sum(bag.size for group in groups for bag in group)
    plan = Plan([], [])
    for group in groups:
        why = _why(group, left, limits, now)
        if not why:
            continue
        stays = _why_kept(group)
        if stays:
            plan.kept.extend(Removal(bag, stays) for bag in group)
            continue
        plan.removals.extend(Removal(bag, why) for bag in group)
        left -= sum(bag.size for bag in group)
    return plan


def _why(group: Sequence[KnownBag], left: int, limits: Limits, now: float) -> str:
    age_s = now - max(bag.closed_at for bag in group)
    if limits.days and age_s > limits.days * DAY_S:
        return '{:.1f} days old'.format(age_s / DAY_S)
    if limits.gb and left > limits.gb * GB:
        return 'the oldest of {:.3f} GB'.format(left / GB)
    return ''


def _why_kept(group: Sequence[KnownBag]) -> str:
    for bag in group:
        if bag.why_kept:
            return bag.why_kept if len(group) == 1 else '{}: {}'.format(bag.path, bag.why_kept)
    ended = {trial for bag in group for trial in bag.ended}
    open_trials = sorted({trial for bag in group for trial in bag.trials} - ended)
    return (
        'trial {} has not ended, or has a question open'.format(open_trials[0])
        if open_trials
        else ''
    )


def _groups(bags: Sequence[KnownBag]) -> List[List[KnownBag]]:
    """Return the bags in groups: those that have trials in common belong together."""
    groups: List[List[KnownBag]] = []
    of_trials: Dict[str, List[KnownBag]] = {}
    for bag in bags:
        found = {id(each): each for each in map(of_trials.get, bag.trials) if each is not None}
        *smaller, mine = sorted(found.values(), key=len) or [[]]
        if not found:
            groups.append(mine)
        added = [bag, *(each for other in smaller for each in other)]
        mine += added
        for other in smaller:
            other.clear()
        of_trials.update((trial, mine) for each in added for trial in each.trials)
    return [group for group in groups if group]


def sizes(removals: Iterable[Removal]) -> int:
    """Return the bytes of what goes."""
    return sum(removal.bag.size for removal in removals)
