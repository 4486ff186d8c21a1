"""The model's Iterators: from item to item, and how they go on when they are entered again."""

from typing import Any, Dict, List, Optional

from .parts import Jumping, Part, Raised, Unsaid, View
from .plan import Leaf, Repeated
from .scheduling import Course


class IteratorPart(Part):
    """An Iterator."""

    plan: Repeated

    def __init__(self, run: Any, plan: Repeated, path: str, parent: Any) -> None:
        super().__init__(run, plan, path, parent)
        self.userdata: Dict[str, Any] = {}
        self._child = run.branch_of(plan.child, path, self)
        self._branches = [plan.child.label] if isinstance(plan.child, Leaf) else []
        self._runs = False
        self._begun: Dict[str, Any] = {}  # what it was given when it began
        self._at_item: Dict[str, Any] = {}  # its userdata when the latest item began
        self._is_asked = False  # to go on
        self.ended_with: Optional[str] = None  # None: by an error, or it was left
        self.forget()

    def children(self) -> List[Part]:
        return [self._child]

    def forget(self) -> None:
        """Begin again the next time: in another trial, or for another item of one around."""
        self._item: Optional[int] = None  # the one under way
        self._is_finished = False
        self._is_exhausted = False
        self._is_asked = False

    def ask_to_go_on(self, goes_on: bool) -> None:
        """Go on with the unfinished item the next time, or begin again."""
        self._is_asked = goes_on

    def request_preempt(self) -> None:
        self.flag = True
        if self._runs:
            self._child.request_preempt()

    def execute(self, view: View) -> Course:
        """Go through the items; returns the outcome."""
        goes_on = self._is_asked and self._item is not None and not self._is_exhausted
        self._is_asked = False
        if goes_on and isinstance(self._child, IteratorPart):
            self._child.ask_to_go_on(not self._is_finished)
        return self.run.between_ends(self, self._branches, self._execute(view, goes_on))

    def _execute(self, view: View, goes_on: bool) -> Course:
        self._take_inputs(view, goes_on)
        self.ended_with = None
        self._runs = True
        self.settled = False
        try:
            outcome = yield from self._iterate(self._first_item(goes_on))
        except Raised:
            self._runs = self.run.is_upstream  # whose Iterator does not end by an error
            self.settled = self._child.settled
            raise
        except Jumping:
            self._runs = False
            self.flag = False
            self.left_with = self._mapped(self._child.left_with)
            view.copy_from(self.keys, self.userdata)
            raise
        self._runs = False
        self.flag = False
        view.copy_from(self.keys, self.userdata)
        self.ended_with = self.plan.final_map.get(outcome, outcome)
        return self.ended_with

    def _mapped(self, outcome: str) -> str:
        if isinstance(outcome, Unsaid):
            return outcome.mapped(self.plan.final_map)
        return self.plan.final_map.get(outcome, outcome)

    def _take_inputs(self, view: View, goes_on: bool) -> None:
        """Take the input keys; what finished items have made of them stays where it goes on."""
        given: Dict[str, Any] = {}
        view.copy_to(self.keys, given)
        if not goes_on:
            self._begun = dict(given)
        elif not self._is_finished and self.run.plan.userdata == 'restore':
            self.userdata.clear()
            self.userdata.update(self._at_item)
        for key, value in given.items():
            if not (goes_on and key in self.userdata and self._begun.get(key) == value):
                self.userdata[key] = value

    def _first_item(self, goes_on: bool) -> int:
        if not goes_on:
            self._item, self._is_exhausted = None, False
        if self._item is None:
            return 0
        return self._item + int(self._is_finished)

    def _iterate(self, first: int) -> Course:
        child = self._child
        for number in range(first, self.plan.items):
            if number != self._item:
                self.run.forget_rests_below(child)
            self._item, self._is_finished = number, False
            if self.flag and not self.run.is_upstream:
                child.request_preempt()
            self._at_item = dict(self.userdata)
            outcome = yield from child.execute(View(self.userdata, {}))
            self.settled = child.settled
            self.ended_as_meant = child.ended_as_meant
            loops = outcome in self.plan.loop_outcomes
            self._is_finished = loops and outcome != 'preempted' and not self.flag
            if self.flag or not loops:
                return outcome
        self._is_exhausted = True
        self.settled = False
        return 'ok'
