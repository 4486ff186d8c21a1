"""Counts bags on a cluster, whose machines see the same folders."""

import os
from typing import Callable, List, Optional, Sequence, Tuple

from smach_oracle.cluster import ClusterError, WorkerCluster, WorkersLost

from ..bag_events import EventReader
from .counted_bag import BeginCount, CountedBag, Counting, count_bag

_File = Tuple[str, int]  # path, bytes. -1: it is not there


class ClusterCount:
    """Has workers count. What dead workers leave, this process counts."""

    def __init__(self, cluster: WorkerCluster, counting: Counting, count_here: BeginCount) -> None:
        """`count_here`: counts in this process, once it is waited for."""
        self._cluster = cluster
        self._counting = counting
        self._count_here = count_here
        self._lost = False

    def begin(self, paths: Sequence[str]) -> Callable[[], List[CountedBag]]:
        """Begin to count some bags."""
        here = self._count_here(paths)
        if self._lost or not paths:
            return here
        files = [(path, _size(path)) for path in paths]
        try:
            future = self._cluster.submit(_count_files, files, self._counting)
        except WorkersLost:
            self._lost = True
            return here

        def counted() -> List[CountedBag]:
            if self._lost:
                return here()
            try:
                found: List[Optional[CountedBag]] = self._cluster.result(future)
            except WorkersLost as err:
                self._cluster.messages.append('{}; their bags are counted here'.format(err))
                self._lost = self._cluster.deserted()
                return here()
            return [bag or self._unseen(file) for bag, file in zip(found, files)]

        return counted

    def _unseen(self, file: _File) -> CountedBag:
        """Count a bag that is another one for a worker.

        :raises ClusterError: where it has not changed: then they see another folder.
        """
        path, size = file
        if _size(path) == size:
            raise ClusterError(
                'a worker does not see {} as it is here; put the folder where all machines see it '
                'under the same path'.format(path)
            )
        return self._count_here([path])()[0]


def _size(path: str) -> int:
    try:
        return os.stat(path).st_size
    except OSError:
        return -1


def _count_files(files: Sequence[_File], counting: Counting) -> List[Optional[CountedBag]]:
    """Count some bags, in a worker. None stands for one that is not as it was told."""
    reader = EventReader()  # of this call, since a worker may have several threads
    return [
        count_bag(path, reader, counting) if _size(path) == size else None for path, size in files
    ]
