"""Userdata, the view a state gets of it, and what crosses the border of a container."""

import copy
import enum
import pickle
import threading

import pytest
from smach_states import Scripted, machine, naming, that_name

import smach


class Pose(object):
    def __init__(self):
        self.x = 1
        self.inner = None

    def norm(self):
        return abs(self.x)


class Mode(enum.Enum):
    AUTO = 1


def view(values, inputs=(), outputs=(), remapping=None):
    ud = smach.UserData()
    for key, value in values.items():
        ud[key] = value
    return ud, smach.Remapper(
        ud, list(inputs), list(outputs), {} if remapping is None else remapping
    )


def test_attributes_and_items_are_the_same_keys():
    ud = smach.UserData()
    ud.a = 1
    ud['b'] = 2
    assert (ud['a'], ud.b, ud.keys(), 'a' in ud, 'c' in ud) == (1, 2, ['a', 'b'], True, False)
    assert ud._data == {'a': 1, 'b': 2}
    ud._data = {'c': 3}
    assert ud.c == 3 and ud.keys() == ['c']


@pytest.mark.parametrize('read', [lambda ud: ud.nope, lambda ud: ud['nope']])
def test_a_missing_key_is_logged_with_those_there_are(read, said):
    ud = smach.UserData()
    ud.a = 1
    with pytest.raises(KeyError):
        read(ud)
    assert len(said('err')) == 1 and that_name(['nope', 'a'], said('err'))


def test_update_extract_and_merge():
    ud, other = smach.UserData(), smach.UserData()
    ud.a, other.b, other.c = 1, 2, [3]
    ud.update(other)
    assert ud._data == {'a': 1, 'b': 2, 'c': [3]}
    assert ud.extract(['a', 'b'], {'new': 'b'})._data == {'a': 1, 'new': 2}
    target = smach.UserData()
    target.merge(ud, ['b', 'c'], {'b': 'new'})
    assert target._data == {'new': 2, 'c': [3]}
    target.c.append(4)
    assert ud.c == [3]


@pytest.mark.improvement
def test_a_key_beginning_with_an_underscore_is_a_key():
    ud, remapper = view({}, ['_hidden'], ['_hidden'])
    ud._hidden = 1
    assert ud['_hidden'] == 1 and ud.keys() == ['_hidden'] and remapper._hidden == 1
    remapper._hidden = 2
    assert ud._hidden == 2
    with pytest.raises(AttributeError):
        getattr(ud, '_other')  # noqa: B009


@pytest.mark.improvement
def test_userdata_can_be_copied_deeply_and_pickled():
    ud = smach.UserData()
    ud.a = [1]
    shallow, deep, again = copy.copy(ud), copy.deepcopy(ud), pickle.loads(pickle.dumps(ud))
    shallow.b = 2
    assert shallow.a is ud.a and 'b' not in ud
    assert deep.a == again.a == [1] and deep.a is not ud.a


@pytest.mark.improvement
def test_userdata_survives_writers_and_listers_in_many_threads():
    ud, errors = smach.UserData(), []

    def write(name):
        try:
            for number in range(2000):
                ud['%s%d' % (name, number)] = number
                assert len(ud.keys()) > 0
        except Exception as err:
            errors.append(err)

    threads = [threading.Thread(target=write, args=(name,)) for name in 'abcd']
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors and len(ud.keys()) == 8000


def test_a_state_reads_its_inputs_and_writes_its_outputs_under_its_own_names():
    ud, remapper = view({'real': 1}, ['mine'], ['mine', 'made'], {'mine': 'real', 'made': 'result'})
    assert remapper.mine == remapper['mine'] == 1 and 'mine' in remapper
    remapper.mine = 2
    remapper['made'] = 3
    assert ud._data == {'real': 2, 'result': 3}


def test_reading_an_undeclared_key_says_what_is_declared():
    _, remapper = view({'a': 1, 'b': 2}, ['a'], ['b'])
    for read in (lambda: remapper.b, lambda: remapper['b'], lambda: hasattr(remapper, 'b')):
        with pytest.raises(smach.InvalidUserCodeError, match=naming('b', 'a')):
            read()


def test_writing_an_undeclared_key_is_logged_and_changes_nothing(said):
    ud, remapper = view({'a': 1}, ['a'], ['made'])
    remapper.a = 2
    remapper['a'] = 3
    assert ud.a == 1
    assert len(said('err')) == 2 and that_name(['a', 'made'], said('err')) == said('err')


def test_a_missing_input_is_a_key_error():
    _, remapper = view({}, ['a'], [])
    with pytest.raises(KeyError):
        remapper['a']
    with pytest.raises(KeyError):
        getattr(remapper, 'a')  # noqa: B009


@pytest.mark.parametrize('value', [3, 'text', [1], {'a': 1}, (1,), None, b'x'])
def test_plain_values_and_containers_come_as_they_are(value):
    _, remapper = view({'a': value}, ['a'])
    assert remapper.a is value


def test_an_object_read_as_input_only_stays_unchanged():
    pose = Pose()
    pose.inner = Pose()
    _, remapper = view({'pose': pose}, ['pose'])
    assert remapper.pose.x == 1
    remapper.pose.x = 5
    remapper.pose.inner.x = 5
    remapper.pose.new = 5
    assert (remapper.pose.x, remapper.pose.inner.x, hasattr(remapper.pose, 'new')) == (1, 1, False)
    with pytest.raises(TypeError):
        del remapper.pose.x
    assert pose.x == pose.inner.x == 1 and not hasattr(pose, 'new')


def test_who_sets_an_attribute_of_an_input_reads_it_back_and_nobody_else_does():
    pose = Pose()
    _, remapper = view({'pose': pose}, ['pose'])
    mine = remapper.pose
    mine.x = 5
    mine.x += 1
    mine.inner = mine
    assert (mine.x, mine.inner.x, remapper.pose.x, remapper.pose.inner) == (6, 6, 1, None)


def test_a_state_that_sets_an_attribute_of_an_input_does_not_end_the_machine():
    def work(state, ud):
        ud.pose.x = 5
        return 'done'

    sm = machine(('A', Scripted(work, input_keys=['pose']), None))
    sm.userdata.pose = Pose()
    assert sm.execute() == 'done' and sm.userdata.pose.x == 1


@pytest.mark.improvement
def test_setting_an_attribute_of_an_input_is_warned_of_once(said):
    class Goal(Pose):
        pass

    _, remapper = view({'goal': Goal()}, ['goal'])
    for _ in range(3):
        remapper.goal.x = 5
    assert len(said('warn')) == 1 and that_name(['x'], said('warn')) and 'Goal' in said('warn')[0]
    remapper.goal.y = 5
    assert len(said('warn')) == 2 and not said('err')


@pytest.mark.improvement
@pytest.mark.parametrize(
    'copier', [copy.copy, copy.deepcopy, lambda pose: pickle.loads(pickle.dumps(pose))]
)
def test_a_copy_has_what_was_set_on_the_view(copier):
    pose = Pose()
    _, remapper = view({'pose': pose}, ['pose'])
    mine = remapper.pose
    mine.x = 5
    twin = copier(mine)
    twin.inner = 7
    assert (type(twin), twin.x, twin.inner, pose.x, pose.inner) == (Pose, 5, 7, 1, None)


@pytest.mark.improvement
def test_a_read_only_object_otherwise_behaves_like_the_object():
    pose = Pose()
    _, remapper = view(
        {'pose': pose, 'mode': Mode.AUTO, 'function': len}, ['pose', 'mode', 'function']
    )
    assert remapper.pose == pose and isinstance(remapper.pose, Pose) and remapper.pose.norm() == 1
    assert remapper.mode is Mode.AUTO and remapper.function([1]) == 1
    mine = copy.deepcopy(remapper.pose)
    mine.x = 7
    assert (mine.x, pose.x) == (7, 1)


def test_an_object_that_is_also_an_output_is_the_object():
    pose = Pose()
    _, remapper = view({'pose': pose}, ['pose'], ['pose'])
    remapper.pose.x = 5
    assert pose.x == 5


@pytest.mark.improvement
def test_keys_lists_the_inputs_there_are_by_the_names_of_the_state():
    _, remapper = view(
        {'real': 1, 'other': 2, 'plain': 3}, ['mine', 'plain', 'missing'], [], {'mine': 'real'}
    )
    assert remapper.keys() == ['mine', 'plain']


def test_keys_declared_between_two_visits_count():
    seen = []

    def work(state, ud):
        if seen:
            seen.append(ud.extra)
            return 'done'
        state.register_input_keys(['extra'])
        seen.append(None)
        return 'failed'

    sm = machine(('A', Scripted(work), {'failed': 'A'}))
    sm.userdata.extra = 4
    assert sm.execute() == 'done' and seen == [None, 4]


def test_private_key_sets_and_userdata_exchanged_between_visits_count():
    seen = []

    def work(state, ud):
        seen.append(ud.a)
        if len(seen) == 2:
            return 'done'
        sm.userdata = smach.UserData()
        sm.userdata.b = 2
        sm._remappings['A'] = {'a': 'b'}
        state._input_keys = {'a', 'more'}
        return 'failed'

    sm = machine(('A', Scripted(work, input_keys=['a']), {'failed': 'A'}))
    sm.userdata.a = 1
    assert sm.execute() == 'done' and seen == [1, 2]


def test_a_state_that_computes_its_keys_is_asked_every_time():
    class Computed(Scripted):
        def get_registered_input_keys(self):
            return ('a',)

    sm = machine(('A', Computed(lambda state, ud: 'done' if ud.a == 1 else 'failed'), None))
    sm.userdata.a = 1
    assert sm.execute() == 'done'


def nested(work, remapping=None, **keys):
    inner = machine(('I', Scripted(work, io_keys=['a', 'b']), None), **keys)
    outer = smach.StateMachine(['done', 'failed', 'preempted'])
    with outer:
        smach.StateMachine.add('IN', inner, None, remapping)
    return outer, inner


def test_inputs_are_copied_in_and_outputs_out_through_the_remapping():
    def work(state, ud):
        ud.b = ud.a + 1
        return 'done'

    outer, inner = nested(work, {'a': 'given', 'b': 'result'}, input_keys=['a'], output_keys=['b'])
    outer.userdata.given = 1
    inner.userdata.own = 0
    assert outer.execute() == 'done'
    assert outer.userdata._data == {'given': 1, 'result': 2}
    assert inner.userdata._data == {'own': 0, 'a': 1, 'b': 2}


def test_missing_inputs_and_outputs_are_warnings(said):
    outer, _ = nested(lambda state, ud: 'done', input_keys=['a'], output_keys=['b'])
    assert outer.execute() == 'done'
    of_input, of_output = said('warn')
    assert that_name(['a'], [of_input]) and 'input' in of_input
    assert that_name(['b'], [of_output]) and 'output' in of_output


def test_a_parent_userdata_is_read_and_written():
    sm = machine(
        (
            'A',
            Scripted(lambda state, ud: setattr(ud, 'b', ud.a) or 'done', io_keys=['a', 'b']),
            None,
        ),
        input_keys=['a'],
        output_keys=['b'],
    )
    parent = smach.UserData()
    parent.a = 3
    assert sm.execute(parent) == 'done' and parent.b == 3


def adding(*states, add=smach.StateMachine.add):
    """A machine of (label, state, arguments of add) triples."""
    made = smach.StateMachine(['done', 'failed', 'preempted'])
    with made:
        for label, state, arguments in states:
            add(label, state, **arguments)
    return made


def test_constants_are_keys_of_the_machine_written_before_the_state_and_kept():
    seen = []

    def work(state, ud):
        seen.append((ud.n, ud['n'], 'n' in ud, state.sm.userdata.answer))
        return 'done'

    state = Scripted(work, input_keys=['n'])
    given = {'remapping': {'n': 'answer'}, 'constants': {'answer': 42}}
    sm = state.sm = adding(('A', state, given))
    assert 'answer' not in sm.userdata
    assert sm.execute() == 'done' and seen == [(42, 42, True, 42)]
    assert sm.userdata._data == {'answer': 42}


def test_a_constant_may_be_written_and_is_itself_again_at_the_next_visit():
    seen = []

    def work(state, ud):
        seen.append(ud.speed)
        ud.speed = 9
        return 'failed' if len(seen) < 3 else 'done'

    sm = adding(
        (
            'A',
            Scripted(work, io_keys=['speed']),
            {'transitions': {'failed': 'A'}, 'constants': {'speed': 0.5}},
        )
    )
    sm.userdata.speed = 1
    assert sm.execute() == 'done' and seen == [0.5, 0.5, 0.5] and sm.userdata.speed == 9


def test_a_constant_stays_for_the_states_that_follow_and_needs_no_declaration():
    def read(state, ud):
        return ud.mode

    sm = adding(
        ('A', Scripted('failed'), {'transitions': {'failed': 'B'}, 'constants': {'mode': 'done'}}),
        ('B', Scripted(read, input_keys=['mode']), {}),
    )
    assert sm.execute() == 'done'


def test_constants_are_looked_at_when_the_state_runs():
    constants = {'a': 1}
    seen = []
    sm = adding(
        (
            'A',
            Scripted(lambda state, ud: seen.append(ud.a) or 'done', input_keys=['a']),
            {'constants': constants},
        )
    )
    sm.execute()
    constants['a'] = 2
    sm.execute()
    sm._constants['A'] = {'a': 3}
    sm.execute()
    assert seen == [1, 2, 3]


def test_constants_that_are_no_mapping_are_an_error_when_the_state_runs():
    sm = adding(('A', Scripted('done'), {'constants': ['a']}))
    with pytest.raises(smach.InvalidUserCodeError):
        sm.execute()


def test_add_auto_takes_constants_too():
    def read(state, ud):
        return ud.mode

    sm = adding(
        (
            'A',
            Scripted(read, input_keys=['mode']),
            {'connector_outcomes': ['failed'], 'constants': {'mode': 'failed'}},
        ),
        (
            'B',
            Scripted(read, input_keys=['mode']),
            {'connector_outcomes': [], 'constants': {'mode': 'done'}},
        ),
        add=smach.StateMachine.add_auto,
    )
    assert sm.execute() == 'done' and sm.userdata.mode == 'done'


@pytest.mark.improvement
def test_the_states_of_a_sequence_may_have_constants():
    sequence = smach.Sequence(['done', 'failed', 'preempted'], 'done')
    with sequence:
        smach.Sequence.add(
            'A',
            Scripted(lambda state, ud: ud.mode, input_keys=['mode']),
            constants={'mode': 'failed'},
        )
    assert sequence.execute() == 'failed'
