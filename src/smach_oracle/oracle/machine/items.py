"""The items of an Iterator, with a memory of how far it has come."""

import itertools
from typing import Any, Callable, Iterable, Iterator, Optional, Sized, Union, cast

from smach_common.foreign import repr_of

from ..identity import has_attribute
from ..smach_private import items_of

Tell = Callable[[str], None]
Items = Union[Iterable[object], Callable[[], Iterable[object]]]


class TrackedItems:
    """Stands in for what an Iterator was given, while it executes.

    An Iterator asks it for an iterator when it begins, and for one item after the other. With
    `goes_on` set, where it has items left, it goes on the next time with the item that was not
    finished. An item is finished once the Iterator asks for the next one. It does not after an
    outcome that breaks, nor once it is preempted. To whoever looks at it otherwise it is what the
    Iterator was given.
    """

    def __init__(self, given: Items, tell: Tell) -> None:
        """`given`: an iterable, or a callable that returns one. `tell` takes words for the log."""
        self.given = given
        self.goes_on: bool
        self.begins: Optional[Callable[[], None]] = None  # called as an item begins
        self.begins_with: int  # number of the item that is the first where it begins again
        self.number = 0  # of the item under way, from 1. 0 means none
        self.is_finished = True  # the item under way
        self.is_exhausted = False
        self._tell = tell
        self._count: Optional[int] = None
        self._items: Optional[Iterator[object]] = None
        self._item: object = None
        self._error: Optional[Exception] = None
        self._is_pending: bool  # whether the item under way is handed out once more

    def has_items_left(self) -> bool:
        """Whether it has begun and items may be left, the unfinished one among them."""
        return bool(self.number) and not self.is_exhausted

    def in_words(self) -> str:
        """Return 'item 2 of 4', without the count where nobody knows it, or '' before the first."""
        if not self.number:
            return ''
        count = self._count
        if count is None or count < self.number:
            return 'item {}'.format(self.number)
        return 'item {} of {}'.format(self.number, count)

    def tell_of_repeats(self) -> None:
        """Say which items are done again, as it begins with the first one after it was left."""
        done = self.number if self.is_finished else self.number - 1
        if done:
            self._tell(
                'begins with its first item again: {} that had ended {} repeated'.format(
                    *(('item 1', 'is') if done == 1 else ('items 1 to {}'.format(done), 'are'))
                )
            )

    def __iter__(self) -> Iterator[object]:
        if self.goes_on:
            self._go_on()
        else:
            self._begin()
        self.goes_on = False
        return self._hand_out()

    def _begin(self) -> None:
        source = self._source()
        if self._items is source:
            self._tell(
                'what it goes through can be iterated only once, and that was begun before; '
                'it goes on where that has ended'
            )
        self._items = iter(source)
        self._count = len(source) if isinstance(source, Sized) else None
        self.is_finished, self.is_exhausted = True, False
        self._is_pending, self._error = False, None
        passed = max(0, self.begins_with - 1)
        for _ in range(passed):
            next(self._items, None)
        self.number, self.begins_with = passed, 1
        if passed:
            self._tell('goes on with item {}'.format(passed + 1))

    def _source(self) -> Iterable[object]:
        return self.given() if callable(self.given) else self.given

    def _go_on(self) -> None:
        """Hand out the unfinished item once more, and those that have not come yet after it."""
        self._look_for_changes()
        if self._error is not None:
            self._begin_behind_finished()
        self._is_pending = not self.is_finished
        self._tell(
            (
                'goes on behind {}' if self.is_finished else 'goes on with {}, which is repeated'
            ).format(self.in_words())
        )

    def _look_for_changes(self) -> None:
        if callable(self.given) or not isinstance(self.given, Sized):
            return
        count = len(self.given)
        if count != self._count:
            self._tell(
                'what it goes through has changed: it had {} items, and has {}'.format(
                    self._count, count
                )
            )
            self._count = count

    def _begin_behind_finished(self) -> None:
        """After an error in getting an item: get the items again, and pass over those handed out.

        :raises Exception: the same error, where they can be got only once.
        """
        items = iter(self._source())
        if items is self._items:
            self._tell('what it goes through can be iterated only once, and has raised an error')
            raise cast('Exception', self._error)
        for _ in range(self.number):
            next(items, None)  # it may raise again: the next time begins here once more
        self._items, self._error = items, None

    def _hand_out(self) -> Iterator[object]:
        again = [self._item] if self._is_pending else []
        self.number -= len(again)
        try:
            for item in itertools.chain(again, cast('Iterator[object]', self._items)):
                self._item = item
                self.number += 1
                self.is_finished = False
                if self.begins is not None:
                    self.begins()
                yield item
                self.is_finished = True
        except Exception as err:  # of whoever makes the items
            self._error = err
            self._tell(
                'cannot get the item behind {}: {}'.format(
                    self.in_words() or 'the beginning', repr_of(err)
                )
            )
            raise
        self.is_exhausted = True

    # -- to others it is what was given

    def __len__(self) -> int:
        return len(cast('Sized', self.given))

    def __getitem__(self, index: object) -> object:
        return cast('Any', self.given)[index]

    def __bool__(self) -> bool:
        return bool(self.given)

    def __getattr__(self, name: str) -> object:
        if name.startswith('_'):  # also while it is copied, without attributes
            raise AttributeError(name)
        return getattr(self.given, name)

    def __repr__(self) -> str:
        return repr(self.given)

    def __str__(self) -> str:
        return str(self.given)


def can_be_indexed(iterator: object) -> bool:
    """Whether what an Iterator goes through has the same items in the same order each time."""
    items = items_of(iterator)
    items = items.given if isinstance(items, TrackedItems) else items
    if callable(items):
        return True  # whoever makes them again says what they are
    return (
        has_attribute(items, '__len__')
        and has_attribute(items, '__getitem__')
        and not has_attribute(items, 'keys')
    )
