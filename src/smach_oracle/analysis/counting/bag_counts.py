"""Counts the trials in many bags, bag by bag, in one process or in several.

Bags are counted in groups. What was counted before is taken from where it is kept. The others of a
group are counted here, or by another process while this one takes the groups before it.
"""

from collections import deque
from contextlib import ExitStack
from typing import TYPE_CHECKING, Callable, Deque, Iterator, List, Optional, Sequence

from ..bag_events import EventReader
from .counted_bag import BeginCount, CountedBag, Counting, count_bag

if TYPE_CHECKING:
    from smach_oracle.cluster import WorkerCluster

KEPT_FROM = 500  # bags. Fewer are read each time: it takes no longer than Python's start
SHARED_FROM = 500  # bags. Fewer are counted in one process
GROUP = 64  # bags
CLUSTER_AHEAD = 3  # groups for each place at a worker: nobody waits for the next one


def count_bags(
    paths: Sequence[str], counting: Counting, cluster: Optional['WorkerCluster'] = None
) -> Iterator[CountedBag]:
    """Yield the counts of some bags, in their order.

    :raises ClusterError: where the cluster counts, and sees other folders.
    :raises ImportError: where rosbags is missing.
    """
    reader = EventReader()

    def begin_here(paths: Sequence[str]) -> Callable[[], List[CountedBag]]:
        return lambda: [count_bag(path, reader, counting) for path in paths]

    with ExitStack() as closing:
        begin: BeginCount = begin_here
        ahead = 0
        if cluster is not None:
            from .cluster_count import ClusterCount

            begin = ClusterCount(cluster, counting, begin).begin
            ahead = CLUSTER_AHEAD * cluster.slots()
        elif counting.processes > 1 and len(paths) >= SHARED_FROM:
            begin, ahead = _shared(counting, paths, begin, closing), 4 * counting.processes
        if counting.take is None and len(paths) >= KEPT_FROM:
            begin = _kept(counting, begin, closing)
        begun: Deque[Callable[[], List[CountedBag]]] = deque()
        for at in range(0, len(paths), GROUP):
            begun.append(begin(paths[at : at + GROUP]))
            if len(begun) > ahead:
                yield from begun.popleft()()
        for counted in begun:
            yield from counted()


def _shared(
    counting: Counting, all_paths: Sequence[str], begin_here: BeginCount, closing: ExitStack
) -> BeginCount:
    """Return what has other processes count. They are started once there is something to count."""
    processes: Optional[BeginCount] = None

    def begin(paths: Sequence[str]) -> Callable[[], List[CountedBag]]:
        nonlocal processes
        if processes is None and paths:
            from .other_processes import OtherProcesses  # it takes a while, and what is kept none

            number = counting.processes - 1  # this process counts, too
            others = OtherProcesses(counting, all_paths, begin_here, number)
            closing.callback(others.close)
            processes = others.begin
        return processes(paths) if processes and paths else begin_here(paths)

    return begin


def _kept(counting: Counting, begin_others: BeginCount, closing: ExitStack) -> BeginCount:
    """Return what takes the counts that are kept, has the others counted, and keeps these."""
    from .kept_counts import KeptCounts  # with a database: only where there are many bags
    from .summary_text import shared_by, summaries_in_all, text_of

    kept = KeptCounts(counting.rule)
    shared = shared_by(kept.shared)
    closing.callback(kept.close)

    def begin(paths: Sequence[str]) -> Callable[[], List[CountedBag]]:
        keys = {path: key for path, key in ((path, kept.key_of(path)) for path in paths) if key}
        texts = kept.texts(list(keys.values()))
        read = summaries_in_all(
            {path: texts[key] for path, key in keys.items() if key in texts}, shared
        )
        known = {
            path: CountedBag(path, [(summary, None) for summary in found])
            for path, found in read.items()
        }
        others = begin_others([path for path in paths if path not in known])

        def counted() -> List[CountedBag]:
            found = {bag.path: bag for bag in others()}
            kept.keep(
                {
                    keys[path]: bag.text or text_of([summary for summary, _ in bag.trials])
                    for path, bag in found.items()
                    if path in keys and not bag.reason
                }
            )
            return [known.get(path) or found[path] for path in paths]

        return counted

    return begin
