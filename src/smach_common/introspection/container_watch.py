"""Seeing what the containers of a machine do, without slowing or changing them."""

import threading
import weakref
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import smach

CALLBACK_LISTS = ('_start_cbs', '_transition_cbs', '_termination_cbs')
"""Attributes of a container, on either engine. SMACH cannot take a callback back."""
Report = Callable[['ContainerWatch', str, List[str], Any], None]
"""``report(watch, info, active_states, userdata)``: a container starts, makes a transition or has
ended.
"""


class _Hook(object):
    """The callback a container holds.

    Pickled or copied with its machine it becomes one that does nothing.
    """

    def __init__(self, watch: Optional['ContainerWatch'], info: str) -> None:
        self._watch = weakref.ref(watch) if watch is not None else None
        self._info = info

    def __reduce__(self) -> Tuple[Any, ...]:
        return _Hook, (None, self._info)

    def is_live(self) -> bool:
        """Whether the watch that it calls still reports."""
        watch = self._watch() if self._watch is not None else None
        return watch is not None and watch.is_attached()

    def __call__(self, userdata: Any, states: Sequence[str], *args: Any) -> None:
        watch = self._watch() if self._watch is not None else None
        if watch is not None and (watch.jump_to is not None or watch.is_heard()):
            watch.happened(self._info, userdata, states, args)


class ContainerWatch(object):
    """One container of the tree, at one or more paths, until it is detached."""

    def __init__(self, container: Any, report: Report, is_heard: Callable[[], bool]) -> None:
        self.is_heard = is_heard
        self.container = container
        self.paths: List[str] = []
        self.jump_to: Optional[str] = None
        self._report: Optional[Report] = report
        self._hooks = [_Hook(self, info) for info in ('START', 'TRANSITION', 'TERMINATION')]
        self._register(*self._hooks)

    def _register(self, start: _Hook, transition: _Hook, termination: _Hook) -> None:
        try:
            self.container.register_start_cb(start, [])
            self.container.register_transition_cb(transition, [])
            self.container.register_termination_cb(termination, [])
        except Exception as err:
            # One whose class never called Container.__init__ is shown with each heartbeat.
            smach.logdebug('Introspection cannot follow %r: %r' % (self.container, err))

    def is_attached(self) -> bool:
        """Whether it reports."""
        return self._report is not None

    def detach(self) -> None:
        """Report nothing any more, and take the callbacks out of the container."""
        self._report = None
        for name in CALLBACK_LISTS:
            attributes = vars(self.container)
            if attributes.get(name):
                # another list: the machine may be in the midst of this one
                attributes[name] = [
                    each
                    for each in attributes[name]
                    if not any(each[0] is hook for hook in self._hooks)
                ]

    def happened(
        self, info: str, userdata: Any, states: Sequence[str], args: Sequence[Any]
    ) -> None:
        """Note what has happened. The executing thread calls it."""
        if info == 'TERMINATION':
            self.jump_to = None
            info = 'TERMINATION %s' % (args[0] if args else '')
            states = ['None']
        elif info == 'TRANSITION' and self.jump_to is not None:
            states = self._jump(states)
        report = self._report
        if report is not None:
            report(self, info, [str(state) for state in states], userdata)

    def _jump(self, states: Sequence[str]) -> Sequence[str]:
        label, self.jump_to = self.jump_to, None
        if label not in self.container.get_children():
            return states
        smach.logwarn(
            "Going to '%s' instead of %s, as asked through introspection" % (label, list(states))
        )
        self.container._set_current_state(label)
        return [str(label)]


def is_watched(container: Any) -> bool:
    """Whether a server of ours follows what this container does."""
    return any(
        isinstance(each[0], _Hook) and each[0].is_live()
        for name in CALLBACK_LISTS
        for each in vars(container).get(name, ())
    )


def _children(container: Any) -> Dict[str, Any]:
    # A machine that is being built in another thread may grow while we look. One that is half built
    # may raise anything: what is around it is shown anyway.
    for _ in range(10):
        try:
            return dict(container.get_children())
        except RuntimeError:
            continue
        except Exception as err:
            smach.logdebug('Introspection cannot see into %r: %r' % (container, err))
            break
    return {}


class ContainerTree(object):
    """All containers below a root.

    They are found again at each ``refresh``, since machines grow and get wrapped. Nothing is made
    of what happens while ``is_heard()`` is false, so that a machine nobody looks at runs at its
    speed.
    """

    def __init__(self, report: Report, is_heard: Callable[[], bool] = lambda: True) -> None:
        self._report = report
        self._is_heard = is_heard
        self._roots: List[Tuple[str, Any]] = []
        self._known: Dict[int, ContainerWatch] = {}
        self._lock = threading.RLock()
        self.by_path: Dict[str, ContainerWatch] = {}

    def add_root(self, path: str, state: Any) -> None:
        """Watch ``state`` as ``path``, with all containers in it."""
        with self._lock:
            if (path, id(state)) not in [(known, id(root)) for known, root in self._roots]:
                self._roots.append((path, state))
        self.refresh()

    def clear(self) -> None:
        """Forget all roots."""
        with self._lock:
            self._roots = []
            self.refresh()

    def refresh(self) -> None:
        """Look for containers that came or went."""
        with self._lock:
            found: Dict[str, Any] = {}
            for path, root in self._roots:
                self._collect(path, root, found, ())
            known, self._known = self._known, {}
            paths: Dict[int, List[str]] = {}
            for path, container in found.items():
                paths.setdefault(id(container), []).append(path)
                self._known[id(container)] = known.get(id(container)) or ContainerWatch(
                    container, self._report, self._is_heard
                )
            for key, watch in self._known.items():
                watch.paths = paths[key]
            self.by_path = {path: self._known[id(container)] for path, container in found.items()}
            for key in set(known).difference(self._known):
                known[key].detach()

    def _collect(
        self, path: str, state: Any, found: Dict[str, Any], above: Tuple[int, ...]
    ) -> None:
        if not isinstance(state, smach.Container) or id(state) in above:
            return
        found[path] = state
        for label, child in _children(state).items():
            self._collect('%s/%s' % (path.rstrip('/'), label), child, found, above + (id(state),))
