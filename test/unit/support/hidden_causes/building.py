"""Plain SMACH made of a plan: what an author would have written."""

import threading
from typing import Any, Dict, Optional, Sequence

import smach

from .causes import loop_of
from .chance import drawn
from .mix import Mix
from .plan import CONCURRENT, DONE, ITERATED, PREEMPTED, Box, Leaf, leaves_of
from .world import World

MOST_LOOPS = 2  # of a trial

LONGEST_END = 1000  # states that a machine may enter once it is preempted


class Scene:
    """What the states of one machine share."""

    def __init__(self, world: World, mix: Mix) -> None:
        self.world = world
        self.mix = mix
        self.top: Any = None
        self.begin(0)

    def begin(self, trial: int) -> None:
        """Begin a trial."""
        self.world.begin(trial)
        self.rounds = 0  # in which the author has led the machine back
        self.is_cut = False
        self._entered_since = 0

    def cut(self) -> bool:
        """Whether the trial has taken too long. The machine is then preempted.

        :raises RuntimeError: where its author leads it on then, round and round.
        """
        took_s = self.world.clock.now() - self.world.began_s - self.world.expert_s
        if not self.is_cut and took_s > self.mix.patience_s:
            self.is_cut = True
            self.top.request_preempt()
        self._entered_since += self.is_cut
        if self._entered_since > LONGEST_END:
            raise RuntimeError('it does not end')
        return self.is_cut


class Turns:
    """The branches of a Concurrence work one after the other, so that each run goes alike."""

    def __init__(self, labels: Sequence[str]) -> None:
        self._labels = labels
        self._changed = threading.Condition()
        self._ended: Dict[str, bool] = {}

    def begin(self) -> None:
        """Begin an execution of the Concurrence."""
        with self._changed:
            self._ended = dict.fromkeys(self._labels, False)

    def note_ended(self, running: Sequence[str]) -> None:
        """Note which branches still run."""
        with self._changed:
            self._ended = {label: label not in running for label in self._labels}
            self._changed.notify_all()

    def wait(self, label: str, state: smach.State) -> None:
        """Wait until the branches before have ended, or until the state is preempted."""
        with self._changed:
            self._changed.wait_for(
                lambda: (
                    state.preempt_requested()
                    or all(self._ended[each] for each in self._labels[: self._labels.index(label)])
                )
            )

    def wake(self) -> None:
        """Have all that wait look whether they are preempted."""
        with self._changed:
            self._changed.notify_all()


class WorkState(smach.State):
    """A state that works in the hidden world, and keeps its notes in the userdata."""

    def __init__(
        self, scene: Scene, leaf: Leaf, keys: Sequence[str], loop: str, turns: Optional[Turns]
    ) -> None:
        super().__init__(outcomes=list(leaf.outcomes), input_keys=keys, output_keys=keys)
        self._scene = scene
        self._leaf = leaf
        self._loop = loop
        self._turns = turns
        self._tries = tries_key(leaf.path)
        self._work = scene.world.causes.works[leaf.path]
        self._loops = (-1, 0)  # trial, and how often it has led back in it
        self.text = ''  # of its latest failure

    def request_preempt(self) -> None:
        """Wake it, where it waits for its turn."""
        super().request_preempt()
        if self._turns is not None:
            self._turns.wake()

    def execute(self, ud: Any) -> str:
        """Do the work."""
        leaf, scene = self._leaf, self._scene
        if self._turns is not None:
            self._turns.wait(leaf.label, self)
        if scene.cut() or self.preempt_requested():
            self.service_preempt()
            return PREEMPTED if leaf.is_preemptable else leaf.work[0]
        tries = ud[self._tries] if self._tries in self.get_registered_input_keys() else 0
        effect = scene.world.execute(leaf.path, tries, self._has_doubles(ud))
        if not effect.works:
            if self._tries in self.get_registered_output_keys():
                ud[self._tries] = tries + 1
            self.text = effect.text
            if not leaf.failing:
                raise RuntimeError(effect.text)
            return leaf.failing[self._which(len(leaf.failing))]
        self._note(ud)
        return self._loop if self._leads_back() else leaf.work[0]

    def _which(self, count: int) -> int:
        """Which of its failing outcomes: mostly the first, and for the same text the same."""
        name = drawn('outcome', self._leaf.path, self.text)
        return 0 if name < 0.7 else int((name - 0.7) / 0.3 * count)

    def _has_doubles(self, ud: Any) -> bool:
        if not self._work.reads:
            return False
        entries = ud[self._work.reads]
        return len(set(entries)) < len(entries)

    def _note(self, ud: Any) -> None:
        key = self._work.appends_to
        if not key:
            return
        entry = 'round {}'.format(self._scene.rounds)
        if self._work.in_place:
            ud[key].append(entry)
        else:
            ud[key] = ud[key] + [entry]

    def _leads_back(self) -> bool:
        world = self._scene.world
        trial, count = self._loops
        count = count if trial == world.trial else 0
        if not self._loop or count >= MOST_LOOPS:
            return False
        seed = world.causes.seed
        if drawn(seed, world.trial, 'loops', self._leaf.path, count) >= self._scene.mix.loops:
            return False
        self._loops = (world.trial, count + 1)
        self._scene.rounds += 1
        return True


def tries_key(path: str) -> str:
    """The key of the userdata in which a state notes how often it has failed."""
    return 'tries_' + path.replace('/', '_')


def keys_of(scene: Scene, box: Box) -> Dict[str, Any]:
    """The keys of the userdata, with the values with which a trial begins."""
    causes = scene.world.causes
    keys: Dict[str, Any] = {
        tries_key(leaf.path): 0
        for leaf in leaves_of(box)
        if any(causes.conditions[name].variant for name in causes.works[leaf.path].needs)
    }
    keys.update((work.appends_to, []) for work in causes.works.values() if work.appends_to)
    return keys


def build(scene: Scene, box: Box) -> smach.StateMachine:
    """The machine of a plan."""
    keys = list(keys_of(scene, box))
    scene.top = _machine(scene, box, keys)
    return scene.top


def _node(scene: Scene, node: Any, around: Box, keys: Sequence[str]) -> smach.State:
    if isinstance(node, Leaf):
        return WorkState(scene, node, _own_keys(scene, node, keys), loop_of(node, around), None)
    return _BUILDERS[node.kind](scene, node, keys)


def _own_keys(scene: Scene, leaf: Leaf, keys: Sequence[str]) -> Sequence[str]:
    work = scene.world.causes.works[leaf.path]
    return [key for key in keys if key in (tries_key(leaf.path), work.appends_to, work.reads)]


def _machine(scene: Scene, box: Box, keys: Sequence[str]) -> smach.StateMachine:
    machine = smach.StateMachine(list(box.outcomes), list(keys), list(keys))
    with machine:
        for child in box.children:
            smach.StateMachine.add(
                child.label, _node(scene, child, box, keys), transitions=dict(child.leads)
            )
    return machine


def _concurrence(scene: Scene, box: Box, keys: Sequence[str]) -> smach.Concurrence:
    labels = [child.label for child in box.children]
    turns = Turns(labels)
    machine = smach.Concurrence(
        list(box.outcomes),
        default_outcome=box.ends[0],
        input_keys=list(keys),
        output_keys=list(keys),
        outcome_map={DONE: dict.fromkeys(labels, DONE)},
    )
    machine.register_start_cb(lambda ud, started: turns.begin())
    machine.register_transition_cb(lambda ud, running: turns.note_ended(running))
    with machine:
        for leaf in box.children:
            state = WorkState(scene, leaf, _own_keys(scene, leaf, keys), '', turns)
            smach.Concurrence.add(leaf.label, state)
    return machine


def _iterator(scene: Scene, box: Box, keys: Sequence[str]) -> smach.Iterator:
    machine = smach.Iterator(
        list(box.outcomes),
        list(keys),
        list(keys),
        it=list(range(box.items)),
        it_label='item',
        exhausted_outcome=DONE,
    )
    inside = box.children[0]
    with machine:
        smach.Iterator.set_contained_state(
            inside.label, _machine(scene, inside, keys), loop_outcomes=[DONE]
        )
    return machine


_BUILDERS = {'machine': _machine, CONCURRENT: _concurrence, ITERATED: _iterator}
