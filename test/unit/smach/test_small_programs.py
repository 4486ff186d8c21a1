"""Small programs of every kind run bare, observed and under an oracle, and each does the same.

A program is a kind of machine and the way in which its state WORK ends. It is executed twice; the
second time WORK ends well. What is compared is all that a script can see: outcomes, exceptions,
transitions, what each state read, and the userdata of every container.
"""

import threading

import pytest
from waiting import wait_for

import smach
from smach_oracle.oracle import OracleContainer

OUTCOMES = ['done', 'aborted', 'preempted']
ENDINGS = {
    'ends well': 'done',
    'fails': 'aborted',
    'raises': smach.InvalidUserCodeError,
    'is preempted': 'preempted',
}
ODD_ENDINGS = ('is lost', 'ignores the preempt')  # an outcome that nobody knows; a deaf state


class Stage:
    """What the states of one program share: its top machine, and what they have read."""

    def __init__(self, ending):
        self.ending = ending
        self.top = None
        self.containers = {}
        self.read = {}  # by label: what its state has read, visit by visit
        self.told = []  # transitions, from callbacks

    def add_container(self, name, container):
        """Watch a container; Concurrences tell in no certain order, so that none is asked."""
        self.containers[name] = container
        if not isinstance(container, smach.Concurrence):
            container.register_transition_cb(
                lambda ud, active: self.told.append((name, active, sorted(ud.keys())))
            )
            container.register_termination_cb(
                lambda ud, last, outcome: self.told.append((name, last, outcome))
            )
        return container


class Adding(smach.State):
    """Adds one to `count`."""

    def __init__(self, stage, label):
        smach.State.__init__(self, OUTCOMES, io_keys=['count'])
        self.stage, self.label = stage, label

    def execute(self, ud):
        self.stage.read.setdefault(self.label, []).append(ud.count)
        ud.count = ud.count + self.step(ud)
        return self.end(len(self.stage.read[self.label]))

    def step(self, ud):
        return 1

    def end(self, visit):
        return 'done'

    def wait_for_preempt(self, in_vain=lambda: False):
        assert wait_for(lambda: self.preempt_requested() or in_vain()), 'no preempt has come'
        if not self.preempt_requested():
            return 'done'
        self.service_preempt()
        return 'preempted'


class Work(Adding):
    """Adds one, or its key `by`; its visit number `at` ends as the program says."""

    def __init__(self, stage, at=1, by=False):
        Adding.__init__(self, stage, 'WORK')
        self.at, self.by = at, by
        if by:
            self.register_input_keys(['by'])

    def step(self, ud):
        return ud.by if self.by else 1

    def end(self, visit):
        ending = self.stage.ending if visit == self.at else 'ends well'
        if ending == 'raises':
            raise ValueError('as the program says')
        if ending == 'is preempted':
            self.stage.top.request_preempt()
            return self.wait_for_preempt()
        if ending == 'ignores the preempt':
            self.stage.top.request_preempt()
            assert wait_for(self.preempt_requested), 'no preempt has come'
            return 'done'
        return ENDINGS.get(ending, 'lost')


class Beside(Adding):
    """Runs beside WORK; where that raises or gets a preempt, it waits to be preempted, too.

    An oracle that has WORK run again leaves nothing to wait for.
    """

    def __init__(self, stage):
        smach.State.__init__(self, OUTCOMES, input_keys=['count'])
        self.stage, self.label = stage, 'BESIDE'

    def execute(self, ud):
        visits = self.stage.read.setdefault(self.label, [])
        visits.append('beside' in ud)
        if self.stage.ending not in ('ends well', 'fails', 'is lost') and len(visits) == 1:
            return self.wait_for_preempt(lambda: len(self.stage.read.get('WORK', ())) > 1)
        return 'done'


def chain(stage, name, middle, cls=smach.StateMachine, start=('FIRST', 'LAST'), **given):
    """FIRST, what is in the middle, LAST; `given` goes to the `add` of the middle."""
    first, last = start
    label, state = middle
    keys = {} if name == 'TOP' else {'input_keys': ['count'], 'output_keys': ['count']}
    made = cls(OUTCOMES, 'done', **keys) if cls is smach.Sequence else cls(OUTCOMES, **keys)
    with made:
        leads = [{'done': label}, {'done': last}, None] if cls is smach.StateMachine else [None] * 3
        cls.add(first, Adding(stage, first), leads[0])
        cls.add(label, state, leads[1], **given)
        cls.add(last, Adding(stage, last), leads[2])
    return stage.add_container(name, made)


def flat(stage):
    return chain(stage, 'TOP', ('WORK', Work(stage)))


def nested(stage):
    inner = chain(stage, 'INNER', ('WORK', Work(stage)), start=('I1', 'I2'))
    middle = chain(stage, 'MIDDLE', ('INNER', inner), start=('M1', 'M2'))
    return chain(stage, 'TOP', ('MIDDLE', middle))


def concurrence(stage):
    both = smach.Concurrence(
        OUTCOMES,
        'aborted',
        input_keys=['count'],
        output_keys=['count'],
        outcome_map={'done': {'WORK': 'done', 'BESIDE': 'done'}, 'aborted': {'WORK': 'aborted'}},
    )
    with both:
        smach.Concurrence.add('WORK', Work(stage))
        smach.Concurrence.add('BESIDE', Beside(stage))
    return chain(stage, 'TOP', ('BOTH', stage.add_container('BOTH', both)))


def machine_in_concurrence(stage):
    both = smach.Concurrence(
        OUTCOMES,
        'aborted',
        input_keys=['count'],
        output_keys=['count'],
        outcome_map={'done': {'INNER': 'done', 'BESIDE': 'done'}},
    )
    with both:
        smach.Concurrence.add(
            'INNER', chain(stage, 'INNER', ('WORK', Work(stage)), start=('I1', 'I2'))
        )
        smach.Concurrence.add('BESIDE', Beside(stage))
    return chain(stage, 'TOP', ('BOTH', stage.add_container('BOTH', both)))


def iterated(stage, state):
    each = smach.Iterator(
        list(OUTCOMES),
        ['count'],
        ['count'],
        it=[1, 2, 3],
        it_label='item',
        exhausted_outcome='done',
    )
    with each:
        smach.Iterator.set_contained_state('EACH', state, loop_outcomes=['done'])
    return chain(stage, 'TOP', ('ALL', stage.add_container('ALL', each)))


def iterator(stage):
    return iterated(stage, Work(stage, at=2))


def machine_in_iterator(stage):
    return iterated(stage, chain(stage, 'INNER', ('WORK', Work(stage, at=2)), start=('I1', 'I2')))


def sequence(stage):
    return chain(stage, 'TOP', ('WORK', Work(stage)), cls=smach.Sequence)


def remapping(stage):
    inner = chain(
        stage, 'INNER', ('WORK', Work(stage, by=True)), start=('I1', 'I2'), remapping={'by': 'step'}
    )
    inner.register_input_keys(['step'])
    top = chain(stage, 'TOP', ('INNER', inner), remapping={'count': 'total', 'step': 'big_step'})
    top.userdata.total, top.userdata.big_step = 100, 20
    return top


def constants(stage):
    inner = chain(
        stage,
        'INNER',
        ('WORK', Work(stage, by=True)),
        start=('I1', 'I2'),
        remapping={'by': 'step'},
        constants={'step': 5},
    )
    return chain(stage, 'TOP', ('INNER', inner), constants={'count': 50, 'mode': 'fast'})


# with what `count` (of remapping: `total`) is after a first execution that ends well
KINDS = {
    flat: 3,
    nested: 7,
    concurrence: 3,
    machine_in_concurrence: 5,
    iterator: 5,
    machine_in_iterator: 11,
    sequence: 3,
    remapping: 122,
    constants: 58,
}

SAID = ('State machine ', 'Iterating ', 'Concurrence starting', 'Concurrent Outcomes')


def ended(machine):
    """The outcome of an execution or the class of what it raised; it must come."""
    results = []

    def run():
        try:
            results.append(machine.execute())
        except Exception as err:
            results.append(type(err))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(30)
    assert results, 'it hangs'
    return results[0]


def story(kind, ending, log, wrap):
    """All that can be seen of two executions of a program."""
    stage = Stage(ending)
    stage.top = kind(stage)
    stage.top.userdata.count = 0
    wrap(stage.top)
    del log[:]
    runs = []
    for _ in range(2):
        result = ended(stage.top)
        runs.append(
            (
                result,
                {
                    name: dict(container.userdata._data)
                    for name, container in stage.containers.items()
                },
            )
        )
    said = [text for level, text in log if level == 'info' and text.startswith(SAID)]
    flags = {name: container.preempt_requested() for name, container in stage.containers.items()}
    return runs, stage.read, stage.told, said, flags


def observed(machine):
    OracleContainer.wrap(machine, recover=False)


def recovered(machine):
    OracleContainer.wrap(machine)


def watched(machine):
    OracleContainer.wrap(machine).events.observers.append(lambda event: None)


PROGRAMS = [(kind, ending) for kind in KINDS for ending in ENDINGS]
NAMES = ['{} {}'.format(kind.__name__, ending) for kind, ending in PROGRAMS]

# what upstream's Concurrence lets its threads raise
pytestmark = pytest.mark.filterwarnings('ignore::pytest.PytestUnhandledThreadExceptionWarning')


@pytest.mark.parametrize('kind, ending', PROGRAMS, ids=NAMES)
def test_a_program_ends_as_it_says(kind, ending, log):
    (first, second), read, told, said, _ = story(kind, ending, log, lambda machine: None)
    assert (first[0], second[0]) == (ENDINGS[ending], 'done')
    assert len(read['LAST']) == (2 if ending == 'ends well' else 1)
    assert len(told) > 3 and len(said) > 3
    if ending == 'ends well':
        assert first[1]['TOP']['total' if kind is remapping else 'count'] == KINDS[kind]


@pytest.mark.improvement
@pytest.mark.parametrize('kind, ending', PROGRAMS, ids=NAMES)
def test_no_program_leaves_a_preempt_standing(kind, ending, log):
    flags = story(kind, ending, log, lambda machine: None)[-1]
    assert flags and not any(flags.values())


@pytest.mark.parametrize('ending', tuple(ENDINGS) + ODD_ENDINGS)
@pytest.mark.parametrize('kind', KINDS)
def test_a_program_that_is_only_observed_does_the_same(kind, ending, log):
    bare = story(kind, ending, log, lambda machine: None)
    assert story(kind, ending, log, observed) == bare


@pytest.mark.parametrize('wrap', [recovered, watched])
@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('ending', ['ends well', 'is preempted'])
def test_a_program_in_which_nothing_fails_does_the_same_under_an_oracle(kind, ending, wrap, log):
    bare = story(kind, ending, log, lambda machine: None)
    assert story(kind, ending, log, wrap) == bare


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('ending', ['fails', 'raises'])
def test_a_program_that_fails_once_recovers_under_an_oracle(kind, ending, log):
    (first, second), read, _, _, _ = story(kind, ending, log, recovered)
    assert (first[0], second[0]) == ('done', 'done') and len(read['LAST']) == 2
