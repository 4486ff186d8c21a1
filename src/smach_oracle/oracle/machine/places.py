"""Places, and the ways between them: the states of all containers of a tree, and the levels above.

The *levels* of a failure are the wrapped containers that are being executed around it: its own, the
one above it, and so on to the top. A *jump path* leads from a failure to a place. Userdata goes
along it through the input and output keys of the author.

"""

from typing import (
    Collection,
    FrozenSet,
    Iterable,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
    Set,
    Tuple,
    Union,
    cast,
)

import smach

from ..decision.policy import FailureContext
from ..decision.ways import KEEP
from ..settings.names import did_you_mean
from ..smach_private import (
    constants_of,
    current_state_of,
    data_of,
    initial_label_of,
    is_executing,
    items_label_of,
    remapping_of,
    states_of,
)
from .nesting import children_of, nodes_of
from .repeats import repeated_by_going_to, why_closed
from .state_record import StateRecord
from .tree_node import TreeNode
from .userdata import UserdataGate, WriteWatch, keys_of_others, missing_keys


class ContainerLink(NamedTuple):
    """A container in the container around it, which may be a Concurrence or an Iterator."""

    outer_container: smach.Container
    label: str
    inner_container: smach.Container

    @property
    def remapping(self) -> Mapping[str, str]:
        """Key of the outer container by key of the inner one, where they differ."""
        return remapping_of(self.outer_container, self.label)


def links_to(node: TreeNode) -> Iterator[ContainerLink]:
    """Yield the links from the wrapped container above one to it, from above to below.

    A top machine has none, such as that of another tree in which a machine lies, too.
    """
    outer: smach.Container = (node.parent or node).machine
    for label in node.labels_from_parent:
        inner = cast('smach.Container', children_of(outer)[label])
        yield ContainerLink(outer, label, inner)
        outer = inner


# -- levels


def levels_above(node: TreeNode) -> Iterator[TreeNode]:
    """Yield the wrapped containers that are being executed around this one, innermost first."""
    child, above = node, node.parent
    while above is not None and is_executing(above.machine):
        state = states_of(above.machine).get(child.labels_from_parent[0])
        # a termination callback may take a state away, and execute it
        if state is None or current_state_of(above.machine) is not state:
            return
        yield above
        child, above = above, above.parent


def nodes_of_tree(node: TreeNode) -> Iterator[TreeNode]:
    """Yield the container itself, the levels above it, and then the others of the tree."""
    first = [node, *levels_above(node)]
    yield from first
    for each in nodes_of(first[-1].machine):
        if not any(each is one for one in first):
            yield each


def direct_levels(node: TreeNode, at_rest: bool = False) -> List[TreeNode]:
    """Return a container and its levels up to a Concurrence or an Iterator, innermost first.

    What runs in the other branches, and what is done of the items, belongs to others.

    `at_rest`: those that they would be, whatever runs.
    """
    levels = [node]
    for above in node.around() if at_rest else levels_above(node):
        if not levels[-1].runs_in_branch:
            levels.append(above)
    return levels


def failure_context(
    node: TreeNode, record: StateRecord, is_counted: bool = False
) -> FailureContext:
    """Return what the visits so far say about a failure of a state of a container.

    `is_counted`: it is among them.

    With `step_back_across` its initial state is that before the container, in the levels above,
    where there is one.
    """
    history = node.records.history
    context_of = history.context_since if is_counted else history.failure_context
    context = context_of(record.label, initial_label_of(node.machine), record.totals[0])
    before = _state_before(node) if node.settings.step_back_across else ''
    return context._replace(initial=before) if before else context


def _state_before(node: TreeNode) -> str:
    """Return the path of the state to which the policies above would step back from a container.

    It is '' where none has run before, or where a Concurrence or an Iterator lies between.
    """
    levels = direct_levels(node)
    for child, above in zip(levels, levels[1:]):
        label = child.labels_from_parent[0]
        context = above.records.history.failure_context(label, '', above.record(label).totals[0])
        name = above.in_force.policy.step_back_target(context)
        if name:
            return name if '/' in name else '/'.join((above.relative_path, name))
    return ''


# -- places


class TreePlace(NamedTuple):
    """One state of one container."""

    node: TreeNode
    label: str

    @property
    def path(self) -> str:
        """Return the path of the container, and the label."""
        return '/'.join((self.node.path, self.label))

    @property
    def relative_path(self) -> str:
        """Return the same below the top machine."""
        return '/'.join(filter(None, (self.node.relative_path, self.label)))


def name_of(place: TreePlace, node: TreeNode) -> str:
    """Return a name of a place by which `place_named` finds it from a container.

    That is its label, or its path where it is in another container.
    """
    return place.label if place.node is node else '/' + place.relative_path


def places_of(node: TreeNode) -> Iterator[TreePlace]:
    """Yield the places of the tree. Those of the container itself come first."""
    for each in nodes_of_tree(node):
        for label in each.labels():
            yield TreePlace(each, label)


def place_at(node: TreeNode, container: str, label: str) -> Optional[TreePlace]:
    """Return the place of a state in the tree, None where there is none.

    :param container: path of its container, '' for the container itself.
    """
    for each in nodes_of_tree(node):
        if each.path == (container or node.path) and each.has(label):
            return TreePlace(each, label)
    return None


def place_named(node: TreeNode, name: str, at_rest: bool = False) -> Optional[TreePlace]:
    """Return the place that a setting names, None where there is none.

    :param name: a label of the container itself, or the path of a state below the top machine,
        which may begin with '/'.
    :param at_rest: whether the whole tree is looked through, and not what is being executed.
    """
    if node.has(name):
        return TreePlace(node, name)
    path = name[1:] if name.startswith('/') else name
    for each in nodes_of(node.top().machine) if at_rest else nodes_of_tree(node):
        above = each.relative_path + '/' if each.relative_path else ''
        if path.startswith(above) and each.has(path[len(above) :]):
            return TreePlace(each, path[len(above) :])
    return None


# -- which places may be named as preconditions of a state, whatever runs


def why_unfit(node: TreeNode, label: str, name: str) -> str:
    """Say why a name cannot be a precondition of a state, or '' where it can.

    A name without '/' is a label of the state's own container, any other one a path.
    """
    if '/' not in name and not (node.site.is_container and name in node.labels()):
        return _where_it_is(node, name) or _unknown(node, label, name)
    place = place_named(node, name, at_rest=True)
    if place is None:
        return _unknown(node, label, name)
    if place.node is node and place.label == label:
        return 'it is the state itself'
    if _is_around(place, node):
        return 'it is a container around the state, and runs meanwhile'
    if not place.node.site.is_container:
        return 'a state of a Concurrence or an Iterator cannot be run alone'
    if _is_in_iterator(place, node):
        return 'it is in an Iterator, and there is no item where it is run alone'
    return ''


def allowed_for(node: TreeNode, label: str) -> str:
    """Say which names may be preconditions of a state."""
    elsewhere = 'PATH/LABEL of a state of another container'
    if not node.site.is_container:
        return elsewhere
    return 'the labels of the other states of {}: {}; or {}'.format(
        node.path, ', '.join(sorted(other for other in node.labels() if other != label)), elsewhere
    )


def _unknown(node: TreeNode, label: str, name: str) -> str:
    names = {
        '/'.join((each.relative_path, state))
        for each in nodes_of(node.top().machine)
        for state in each.labels()
    }
    if node.site.is_container:
        names.update(node.labels())
    own = {label, '/'.join((node.relative_path, label))}
    return 'there is no such state' + did_you_mean(name, names - own)


def _where_it_is(node: TreeNode, name: str) -> str:
    paths = [
        '/'.join((each.relative_path, name))
        for each in nodes_of(node.top().machine)
        if each is not node and name in each.labels()
    ]
    return 'in other containers there is ' + ', '.join(sorted(paths)) if paths else ''


def _is_around(place: TreePlace, node: TreeNode) -> bool:
    return any(
        each.parent is place.node and each.labels_from_parent[0] == place.label
        for each in (node, *node.around())
    )


def _is_in_iterator(place: TreePlace, node: TreeNode) -> bool:
    """Whether an Iterator lies between a place and what is around both."""
    common = (node, *node.around())
    return any(
        isinstance(link.outer_container, smach.Iterator)
        for each in (place.node, *place.node.around())
        if each not in common
        for link in links_to(each)
    )


# -- the way to a place


class JumpPath(NamedTuple):
    """The way from a container to a place: out to where they meet, and down again.

    `left_containers`: those that are left, innermost first. `meeting_node`: of the innermost one
    that holds both. `entered_places`: its own state that is entered, then the states in which the
    containers below it begin. The last one is the place.
    """

    left_containers: Tuple[TreeNode, ...]
    meeting_node: TreeNode
    entered_places: Tuple[TreePlace, ...]

    @property
    def first_label(self) -> str:
        """Return the label of the state of the `meeting_node` that is entered."""
        return self.entered_places[0].label

    @property
    def place(self) -> TreePlace:
        """Return the place to which it leads."""
        return self.entered_places[-1]

    def kept(self, watch: WriteWatch) -> FrozenSet[str]:
        """Return the keys that a recovery wrote and that survive a restore where the ways meet.

        None survives where the container in which they were written is left.
        """
        return frozenset(watch.written_in(self.meeting_node.machine))


def jump_path_to(node: TreeNode, place: Optional[TreePlace]) -> Optional[JumpPath]:
    """Return the way from a container that is being executed to a place.

    None means there is none. There is none where `place` is None.
    """
    if place is None:
        return None
    if place.node is node:
        return JumpPath((), node, (place,))
    levels = [node, *levels_above(node)]
    down: List[TreePlace] = [place]
    while not any(down[0].node is level for level in levels):
        below = down[0].node
        if below.parent is None:
            return None
        down.insert(0, TreePlace(below.parent, below.labels_from_parent[0]))
    index = next(i for i, level in enumerate(levels) if level is down[0].node)
    return JumpPath(tuple(levels[:index]), levels[index], tuple(down))


# -- what is told of a place before the machine goes there


def why_closed_on(way: JumpPath) -> str:
    """Return why a place, or one on the way down, cannot be entered now, '' where it can."""
    for place in way.entered_places:
        why = why_closed(place.node, place.label)
        if why:
            return why if place is way.place else '{} {}'.format(place.path, why)
    return ''


def repeated_on(way: JumpPath) -> Tuple[str, ...]:
    """Return the guarded states that may be repeated if the machine goes to a place."""
    return repeated_by_going_to(way.meeting_node, way.first_label)


def missing_on(way: JumpPath, written: Iterable[str]) -> Tuple[str, ...]:
    """Return the input keys of a place's state that would be missing after the jump.

    :param written: keys of the container of `meeting_node` that survive a restore.
    """
    node, label = way.place
    if not states_of(node.machine)[label].get_registered_input_keys():
        return ()
    keys = set(_keys_after_jump(way.meeting_node, way.first_label, tuple(written)))
    for below in way.entered_places[1:]:
        keys = _keys_below(below.node, keys)
    return missing_keys(node.machine, label, keys)


def _keys_after_jump(node: TreeNode, label: str, written: Collection[str]) -> Tuple[str, ...]:
    """Return the container's userdata keys as they would be after a jump to a state."""
    now = data_of(node.machine.userdata)
    snapshot = node.record(label).snapshot
    if node.in_force.userdata == KEEP or snapshot is None:
        return tuple(now)
    others = keys_of_others(node.machine, snapshot, node.in_force.deep_copy_keys)
    stay = others.union(written)
    return tuple(set(snapshot).difference(stay).union(key for key in stay if key in now))


def _keys_below(below: TreeNode, keys: Set[str]) -> Set[str]:
    """Return the userdata keys of a container when it begins, from those of the one above it."""
    for link in links_to(below):
        child = link.inner_container
        keys = set(data_of(child.userdata)).union(
            key for key in child.get_registered_input_keys() if link.remapping.get(key, key) in keys
        )
        item = items_label_of(child)
        if item is not None:  # an Iterator: its state works on its own userdata
            keys.add(item)
    return keys


# -- userdata between containers


def hand_down(link: ContainerLink) -> Set[str]:
    """Give a container its input keys, as when it begins, and return those that were there."""
    outer = link.outer_container
    given = dict(data_of(outer.userdata))
    if isinstance(outer, smach.StateMachine):
        given.update(constants_of(outer, link.label))
    handed = {key: named for key, named in _inputs(link) if named in given}
    for key, named in handed.items():
        link.inner_container.userdata[key] = given[named]
    return set(handed)


def hand_up(
    link: ContainerLink, written: Set[str], into: Union[UserdataGate, smach.UserData]
) -> Set[str]:
    """Hand output keys of a container that were written to the one above it.

    :param into: where they are written, by keys of the container above.
    :returns: the keys written there.
    """
    outputs = link.inner_container.get_registered_output_keys()
    pairs = ((key, link.remapping.get(key, key)) for key in outputs)
    return _hand_over(link.inner_container, pairs, written, into)


def hand_on(
    link: ContainerLink, written: Set[str], into: Union[UserdataGate, smach.UserData]
) -> Set[str]:
    """Hand what was written in a container to the one below it that runs, by its input keys.

    :param into: where it is written, by keys of the container below.
    :returns: the keys written there.
    """
    pairs = ((named, key) for key, named in _inputs(link))
    return _hand_over(link.outer_container, pairs, written, into)


def _hand_over(
    container: smach.Container,
    pairs: Iterable[Tuple[str, str]],
    written: Set[str],
    into: Union[UserdataGate, smach.UserData],
) -> Set[str]:
    """Hand over keys of a container that were written, each by its name there and its new one."""
    data, found = data_of(container.userdata), set()
    for key, new in pairs:
        if key in written and key in data:
            into[new] = data[key]
            found.add(new)
    return found


def _inputs(link: ContainerLink) -> Sequence[Tuple[str, str]]:
    return [
        (key, link.remapping.get(key, key))
        for key in link.inner_container.get_registered_input_keys()
    ]
