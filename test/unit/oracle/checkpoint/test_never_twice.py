"""A state that is not repeated by itself is not, on whatever way a stored trial goes on."""

import contextlib
import functools
import io
import random

import pytest
from killed_machines import KilledMachine, Noted
from killed_trees import ENDS, make, tree
from left_stores import Left

import smach
from smach_oracle.oracle import Expert
from smach_oracle.oracle.asking.question import Answer, AnswerKind
from smach_oracle.store.state_command import main
from smach_oracle.store.store_file import StoreFile

NEVER = {'states': {'POUR': {'on_retry': 'never'}}}
NO_GUARD = {'states': {}}


class ByHand(Expert):
    """Does by hand whatever it is asked about, and has nothing repeated."""

    def ask(self, question, cancelled, progress):
        return Answer(AnswerKind.SUPERSEDE, outcome='succeeded', by='ann')


class Sends(Expert):
    """Sends the machine to one state first, and does the rest by hand."""

    def __init__(self, state):
        self._state = state

    def ask(self, question, cancelled, progress):
        state, self._state = self._state, ''
        if state:
            return Answer(AnswerKind.GOTO, state=state, by='ann')
        return ByHand().ask(question, cancelled, progress)


@functools.lru_cache(maxsize=None)
def chain(*labels, failing=''):
    """A machine of these states in this order; `failing` does not come to a good end."""

    def build(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'], ['done'], ['done'])
        machine.userdata.done = []
        with machine:
            for label, following in zip(labels, [*labels[1:], 'succeeded']):
                # POUR pours, whatever it is called
                name = 'POUR' if label == 'TEA' else label
                smach.StateMachine.add(
                    label,
                    Noted(name, diary, points, failures=99 * (label == failing)),
                    dict(ENDS, succeeded=following),
                )
        return machine

    return build


@functools.lru_cache(maxsize=None)
def nested(*labels, failures=0):
    """The same in a container, before a last state, which fails so often."""

    def build(diary, points):
        machine = smach.StateMachine(['succeeded', 'aborted'])
        machine.userdata.done = []
        with machine:
            smach.StateMachine.add('KITCHEN', chain(*labels)(diary, points), {'succeeded': 'LAST'})
            last = Noted('LAST', diary, points, failures=failures)
            smach.StateMachine.add('LAST', last, ENDS)
        return machine

    return build


FLAT = chain('LOOK', 'POUR', 'CARRY')
NESTED = nested('LOOK', 'POUR', 'CARRY')


# by machine and settings: what it leaves
LEFT = {}


def left(build, settings):
    """What a machine leaves. With anything patched, make a `Left` of your own."""
    key = (build, repr(settings))
    if key not in LEFT:
        LEFT[key] = Left(build, **settings)
    return LEFT[key]


def killed_in(folder, build, state, **settings):
    """The machine, killed while a state runs."""
    machine = left(build, settings)
    return machine.killed_at(machine.first_in(state), folder)


def oracle_state(killed, *arguments):
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        main([killed.store, *arguments])
    return out.getvalue()


def moment_of(killed, kind, label):
    moments = StoreFile(killed.store, read_only=True).moments(1)
    return next(each.number for each in moments if (each.kind, each.label) == (kind, label))


def settings_only(**settings):
    return lambda killed: settings


def from_moment(kind, label):
    return lambda killed: {'resume_from': moment_of(killed, kind, label)}


def by_goto(label):
    def work(killed):
        oracle_state(killed, 'goto', label)
        return {}

    return work


WAYS = {
    'recover': settings_only(),
    'ask': settings_only(on_resume='ask'),
    'to the state before': settings_only(on_resume='state:LOOK'),
    'to the state itself': settings_only(on_resume='state:POUR'),
    'oracle_state to the state before': by_goto('LOOK'),
    'oracle_state to the state itself': by_goto('POUR'),
    'from the moment before it': from_moment('STATE_START', 'LOOK'),
    'from its own moment': from_moment('STATE_START', 'POUR'),
}
WAYS_DOWN = {
    'to the container': settings_only(on_resume='state:KITCHEN'),
    'to the state before': settings_only(on_resume='state:KITCHEN/LOOK'),
    'to the state itself': settings_only(on_resume='state:KITCHEN/POUR'),
    'oracle_state to the container': by_goto('KITCHEN'),
    'oracle_state to the state before': by_goto('KITCHEN/LOOK'),
    'oracle_state to the state itself': by_goto('KITCHEN/POUR'),
    'from the moment before it': from_moment('STATE_START', 'LOOK'),
    'from that of the container': from_moment('STATE_START', 'KITCHEN'),
}


@pytest.mark.parametrize(
    'expert, guarded_before',
    [(None, NEVER), (ByHand(), NEVER), (None, NO_GUARD)],
    ids=['nobody', 'by hand', 'guarded since'],
)
@pytest.mark.parametrize(
    'build, way, state',
    [
        *[(FLAT, way, state) for way in WAYS for state in ('POUR', 'CARRY')],
        *[(NESTED, way, state) for way in WAYS_DOWN for state in ('POUR', 'CARRY', 'LAST')],
    ],
)
def test_it_is_not_done_twice_without_a_person(tmp_path, build, way, state, expert, guarded_before):
    killed = killed_in(tmp_path / 'killed', build, state, **guarded_before)
    ways = WAYS if build is FLAT else WAYS_DOWN
    more = ways[way](killed)
    told = killed.run(kill_at=6, expert=expert, **{**NEVER, **more})  # killed once more
    if told is None:
        killed.run(expert=expert, **NEVER)
    assert killed.diary.count('begins')['POUR'] == 1


@pytest.mark.parametrize('expert', [None, ByHand()], ids=['nobody', 'by hand'])
@pytest.mark.parametrize('state', ['POUR', 'CARRY'])
@pytest.mark.parametrize(
    'after, names',
    [
        (chain('LOOK', 'TEA', 'CARRY'), {'POUR': 'TEA'}),
        (chain('LOOK', 'POUR', 'DRIVE'), {'CARRY': 'POUR'}),
        (
            nested('LOOK', 'POUR', 'CARRY'),
            {'LOOK': 'KITCHEN/LOOK', 'POUR': 'KITCHEN/POUR', 'CARRY': 'KITCHEN/CARRY'},
        ),
        (chain('POUR', 'LOOK', 'CARRY'), {'CARRY': 'LOOK'}),
    ],
)
@pytest.mark.parametrize(
    'more',
    [{}, {'on_resume': 'state:LOOK'}, {'moment': 'LOOK'}],
    ids=['recover', 'to LOOK', 'from LOOK'],
)
def test_it_is_not_done_twice_under_another_name(tmp_path, after, names, state, expert, more):
    before = killed_in(tmp_path / 'killed', FLAT, state, **NEVER)
    more = dict(more)
    if 'moment' in more:
        more = {'resume_from': moment_of(before, 'STATE_START', more['moment'])}
    elif 'KITCHEN/LOOK' in names.values() and more:
        more = {'on_resume': 'state:KITCHEN/LOOK'}
    label = names.get('POUR', 'POUR').rpartition('/')[2]
    goes_on = KilledMachine(
        tmp_path / 'killed', after, resume_map=names, states={label: {'on_retry': 'never'}}
    )
    told = goes_on.run(kill_at=6, expert=expert, **more)
    if told is None:
        goes_on.run(expert=expert)
    assert goes_on.diary.count('begins')['POUR'] == 1


def test_it_is_not_done_twice_where_the_map_leads_from_what_was_next_to_it(tmp_path):
    """CARRY was next, and is POUR now, by the map."""
    machine = left(FLAT, NEVER)
    for point in [*machine.points(), machine.told['points']]:
        before = machine.killed_at(point, tmp_path / 'killed')
        if 'TOP/CARRY was next' in oracle_state(before):
            break
    else:  # the moment is stored with the next state: by hand
        before = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
        oracle_state(before, 'goto', 'CARRY')
    assert 'TOP/CARRY was next' in oracle_state(before)
    after = KilledMachine(
        tmp_path / 'killed', chain('LOOK', 'POUR'), resume_map={'CARRY': 'POUR'}, **NEVER
    )
    after.run()
    assert after.diary.count('begins')['POUR'] == 1


@pytest.mark.parametrize('expert', [None, ByHand()], ids=['nobody', 'by hand'])
def test_a_jump_of_the_expert_is_not_forgotten_by_a_kill(tmp_path, expert):
    """The expert sends the machine back to LOOK, and it is killed there: POUR is spent still."""
    build = chain('LOOK', 'POUR', 'CARRY', failing='CARRY')
    settings = dict(NEVER, max_recoveries=0)
    machine = Left(build, expert=Sends('LOOK'), **settings)
    killed = machine.killed_at(machine.first_in('LOOK', times=2), tmp_path / 'killed')
    killed.run(max_recoveries=5, expert=expert)
    assert killed.diary.count('begins')['POUR'] == 1


def test_a_precondition_is_not_forgotten_by_a_kill(tmp_path):
    """POUR runs as a precondition of CARRY, and the program is killed meanwhile."""
    build = chain('LOOK', 'CARRY', 'POUR', failing='CARRY')
    settings = {'states': {'POUR': {'on_retry': 'never'}, 'CARRY': {'preconditions': ['POUR']}}}
    killed = killed_in(tmp_path / 'killed', build, 'POUR', **settings)
    killed.run(expert=ByHand())
    assert killed.diary.count('begins')['POUR'] == 1


@pytest.mark.parametrize('build, path', [(FLAT, 'POUR'), (NESTED, 'KITCHEN/POUR')])
def test_a_person_at_a_terminal_has_it_repeated_and_the_log_says_so(tmp_path, build, path):
    killed = killed_in(tmp_path / 'killed', build, 'CARRY', **NEVER)
    said = oracle_state(killed, 'goto', path)
    assert 'on_retry: never' in said and '--repeat ' + path in said
    assert 'CARRY was under way' in oracle_state(killed)
    said = oracle_state(killed, 'goto', path, '--repeat', path)
    assert said == 'it will go on at {}\n'.format(path)
    assert 'go to {0}, and repeat {0}'.format(path) in oracle_state(killed, 'log')
    told = killed.run()
    assert told['outcome'] == 'succeeded'
    assert killed.diary.count('begins')['POUR'] == 2
    assert any('may be repeated once' in line for line in told['log'])


def test_it_is_said_that_a_person_will_be_asked(tmp_path):
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
    assert oracle_state(killed, 'goto', 'LOOK') == (
        'it will go on at LOOK; a person is asked before it repeats POUR\n'
    )
    told = killed.run(expert=ByHand())
    assert told['outcome'] == 'succeeded'


@pytest.mark.parametrize(
    'more', [{'on_resume': 'state:POUR'}, {'on_resume': 'state:LOOK'}, {'moment': 'LOOK'}]
)
def test_the_option_repeat_has_it_repeated_once(tmp_path, more):
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
    if 'moment' in more:
        more = {'resume_from': moment_of(killed, 'STATE_START', more['moment'])}
    told = killed.run(resume_repeat=['POUR'], **more)
    assert told['outcome'] == 'succeeded'
    assert any('TOP/POUR: may be repeated once' in line for line in told['log'])
    assert killed.diary.count('begins')['POUR'] == 2


def test_with_a_machine_all_that_is_in_it_may_be_repeated_once(tmp_path):
    killed = killed_in(tmp_path / 'killed', NESTED, 'CARRY', **NEVER)
    told = killed.run(resume_repeat=['KITCHEN'], on_resume='state:KITCHEN')
    assert told['outcome'] == 'succeeded'
    assert killed.diary.count('begins')['POUR'] == 2


def test_the_trial_is_kept_where_nobody_says_whether_it_may_be_repeated(tmp_path):
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
    told = killed.run(on_resume='state:POUR')
    assert (told['outcome'], told['ended_by']) == (None, 'kept')
    assert killed.run(on_resume='state:POUR', expert=ByHand())['outcome'] == 'succeeded'
    assert killed.diary.count('begins') == {'LOOK': 1, 'POUR': 1, 'CARRY': 2}


def test_a_state_to_be_repeated_that_is_not_there_is_named(tmp_path):
    killed = killed_in(tmp_path / 'killed', FLAT, 'CARRY', **NEVER)
    told = killed.run(resume_repeat=['POURR'], on_resume='state:LOOK')
    assert 'resume_repeat' in told['error'] and 'POURR' in told['error']
    assert "no state 'POURR'" in oracle_state(killed, 'goto', 'LOOK', '--repeat', 'POURR')


@pytest.mark.parametrize('seed', range(6))
def test_of_a_tree_nothing_is_done_twice_whatever_kills_it_and_wherever_it_is_sent(tmp_path, seed):
    """All states are guarded. Each kill, and each way on, is drawn."""
    chance = random.Random('never twice {}'.format(seed))
    killed = KilledMachine(make(tmp_path / 'killed'), tree, on_retry='never')
    told = killed.run(kill_at=chance.randint(6, 90), expert=ByHand())
    states = [
        path
        for path in (
            'A',
            'XY',
            'XY/X',
            'XY/Y',
            'BOTH',
            'BOTH/LEFT',
            'BOTH/RIGHT/M2',
            'PLAIN',
            'PLAIN/I',
            'NESTED',
            'NESTED/JK/K',
            'B',
        )
    ]
    for _ in range(8):
        if told is not None:
            break
        way, more = chance.choice(['recover', 'ask', 'state', 'goto', 'from']), {}
        if way == 'goto':
            oracle_state(killed, 'goto', chance.choice(states))
        elif way == 'from':
            more = {
                'resume_from': chance.choice(
                    [each.number for each in StoreFile(killed.store, read_only=True).moments(1)]
                )
            }
        elif way == 'state':
            more = {'on_resume': 'state:' + chance.choice(states)}
        else:
            more = {'on_resume': way}
        told = killed.run(kill_at=chance.randint(3, 60), expert=ByHand(), **more)
    assert told is None or told.get('ended_by') in ('outcome', 'kept'), told
    begun = killed.diary.count('begins')
    assert {name: count for name, count in begun.items() if count > 1} == {}


def test_a_script_that_has_changed_twice_goes_on_by_the_names_of_each(tmp_path):
    folder = tmp_path / 'killed'
    killed_in(folder, FLAT, 'CARRY')
    second = KilledMachine(folder, chain('LOOK', 'TEA', 'CARRY'), resume_map={'POUR': 'TEA'})
    assert second.run(kill_at=3) is None
    third = KilledMachine(folder, chain('SEE', 'TEA', 'CARRY'), resume_map={'LOOK': 'SEE'})
    told = third.run()
    assert told.get('outcome') == 'succeeded', told
    assert 'TOP: goes on with LOOK as SEE' in told['log']
    assert third.diary.count('begins')['POUR'] == 1


@pytest.mark.parametrize('on_retry', ['never', 'confirm'])
def test_what_was_done_in_a_container_that_goes_on_is_not_repeated_with_it(tmp_path, on_retry):
    """The failure comes later, behind the container."""
    guarded = {'states': {'KITCHEN/POUR': {'on_retry': on_retry}}}
    build = nested('LOOK', 'POUR', 'CARRY', failures=9)
    killed = killed_in(tmp_path, build, 'CARRY', **guarded)
    assert killed.run(expert=ByHand(), **guarded)['outcome'] == 'succeeded'
    begins = killed.diary.count('begins')
    assert begins['POUR'] == 1 and begins['LAST'] > 1
