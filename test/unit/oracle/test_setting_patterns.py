"""Settings by patterns of labels and paths."""

import pytest
from branch_machines import both, inside, iterator_over
from machines import Scripted, Watched, chain_of

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import SettingsError
from smach_oracle.oracle.records.events import EventKind
from smach_oracle.oracle.settings.names import exactness, matches
from smach_oracle.oracle.settings.settings import Settings


@pytest.mark.parametrize(
    'name, path, whether',
    [
        ('PICK', 'PICK', True),
        ('PICK', 'ARM/PICK', True),
        ('PICK', 'ARM/PICKS', False),
        ('ARM/PICK', 'ARM/PICK', True),
        ('ARM/PICK', 'LEFT/ARM/PICK', False),
        ('P*', 'ARM/PICK', True),
        ('P*', 'PAN/GRIP', False),
        ('*', 'A/B', True),
        ('ARM/*', 'ARM/PICK', True),
        ('ARM/*', 'ARM/HAND/PICK', False),
        ('ARM/*', 'ARM', False),
        ('ARM/**', 'ARM/HAND/PICK', True),
        ('ARM/**', 'ARM/PICK', True),
        ('ARM/**', 'ARM', False),
        ('**/PICK', 'PICK', True),
        ('**/PICK', 'A/B/PICK', True),
        ('**/PICK', 'A/B/PICKS', False),
        ('A/**/Z', 'A/Z', True),
        ('A/**/Z', 'A/B/C/Z', True),
        ('A/**/Z', 'B/A/Z', False),
        ('*_*/GO', 'LEFT_ARM/GO', True),
        ('**', 'A/B', True),
        ('A.B', 'AxB', False),
    ],
)
def test_what_a_name_stands_for(name, path, whether):
    assert matches(name, path) is whether


def test_the_most_exact_name_wins():
    names = ['ARM/PICK', 'PICK', 'ARM/P*', 'ARM/*', '**/PICK', '**', 'PIC*', '*']
    order = sorted(names, key=exactness)
    assert order[-2:] == ['PICK', 'ARM/PICK']
    assert order.index('ARM/*') < order.index('ARM/P*') and order.index('*') < order.index('PIC*')
    given = {name: {'memory': number} for number, name in enumerate(names, 1)}
    for found in reversed(order):
        settings = Settings.from_dict({'states': given})
        assert settings.for_state('ARM', 'PICK').memory == given[found]['memory']
        del given[found]
    assert Settings.from_dict({}).for_state('ARM', 'PICK').memory == 10


def test_a_pattern_of_paths_stands_for_states_of_the_top_machine_too():
    hand = {'hand': {'action': 'assist', 'states': ['**/PICK']}}
    settings = Settings.from_dict({'states': {'**/PICK': {'memory': 3}}, 'interfaces': hand})
    assert settings.for_state('', 'PICK').memory == 3
    assert [offer.name for offer in settings.offers_for('', 'PICK')] == ['hand']


def test_names_add_up_key_by_key():
    settings = Settings.from_dict(
        {
            'states': {
                '**': {'memory': 3, 'prior': 0.2},
                'ARM/*': {'prior': 0.3},
                'PICK': {'high_from': 0.9},
            }
        }
    )
    found = settings.for_state('ARM', 'PICK')
    assert (found.memory, found.prior, found.high_from) == (3, 0.3, 0.9)


@pytest.mark.parametrize('name', ['A**', 'A/**B/C', '***'])
def test_a_pattern_that_says_nothing_clear_is_refused(name):
    with pytest.raises(SettingsError, match=r'stands alone'):
        Settings.from_dict({'states': {name: {'memory': 3}}})
    with pytest.raises(SettingsError, match=r'stands alone'):
        Settings.from_dict({'nested': [name]})


def tree(left=None, each=None):
    """The machines ARM and ARM/HAND, the Concurrence BOTH and the Iterator ALL."""
    hand = chain_of(Scripted())
    arm = inside(hand, 'HAND')
    top = smach.StateMachine(['done', 'aborted', 'preempted'])
    top.userdata.done = []
    with top:
        smach.StateMachine.add('ARM', arm, {'done': 'BOTH'})
        smach.StateMachine.add('BOTH', both(left or Scripted(), Scripted()), {'done': 'ALL'})
        smach.StateMachine.add(
            'ALL', iterator_over(each or Scripted(), items=[1, 2]), {'done': 'done'}
        )
    return top, arm, hand


def test_a_pattern_reaches_states_and_branches():
    top, _, _ = tree()
    machine = Watched(
        top,
        name='TOP',
        settings={
            'states': {'**/A': {'prior': 0.2}, 'BOTH/*': {'prior': 0.3}, 'EA*': {'prior': 0.4}}
        },
    )
    rates = {(row.path, row.state): pytest.approx(row.rate) for row in machine.machine.rates()}
    assert rates['TOP/ARM/HAND', 'A'] == 0.2 and rates['TOP/ARM', 'HAND'] == 0.1
    assert rates['TOP/BOTH', 'LEFT'] == rates['TOP/BOTH', 'RIGHT'] == 0.3
    assert rates['TOP/ALL', 'EACH'] == 0.4


@pytest.mark.parametrize('name', ['BOTH/M*', '**/GRIP', 'Q*'])
def test_a_pattern_that_stands_for_no_state_is_refused(name):
    with pytest.raises(SettingsError, match='the states of the machine'):
        OracleContainer.wrap(tree()[0], settings={'states': {name: {'prior': 0.3}}})


def test_a_mistyped_state_is_refused_with_the_one_that_is_meant():
    said = r"'RIHGT' is no state \(did you mean RIGHT\?\); allowed"
    with pytest.raises(SettingsError, match=said):
        OracleContainer.wrap(tree()[0], settings={'states': {'RIHGT': {'prior': 0.3}}})


@pytest.mark.parametrize(
    'nested, paths',
    [
        (True, {'ARM', 'ARM/HAND', 'BOTH/LEFT', 'BOTH/RIGHT', 'ALL/EACH'}),
        (False, set()),
        ([], set()),
        (['ARM'], {'ARM'}),
        (['ARM', 'ARM/HAND'], {'ARM', 'ARM/HAND'}),
        (['ARM/HAND'], set()),
        (['*'], {'ARM', 'ARM/HAND', 'BOTH/LEFT', 'BOTH/RIGHT', 'ALL/EACH'}),
        (['BOTH/*'], {'BOTH/LEFT', 'BOTH/RIGHT'}),
        (['**/LEFT', 'ALL/**'], {'BOTH/LEFT', 'ALL/EACH'}),
    ],
)
def test_nested_says_which_have_oracles_of_their_own(nested, paths):
    top, arm, hand = tree()
    machine = Watched(top, name='TOP', settings={'nested': nested})
    wrapped = {
        name
        for name, each in (('ARM', arm), ('ARM/HAND', hand))
        if isinstance(each, OracleContainer)
    }
    rates = {(row.path + '/' + row.state)[len('TOP/') :] for row in machine.machine.rates()}
    branches = rates.intersection({'BOTH/LEFT', 'BOTH/RIGHT', 'ALL/EACH'})
    assert wrapped | branches == paths
    assert machine.run() == 'done'


def test_a_branch_without_an_oracle_fails_as_bare():
    left, each = Scripted('aborted'), Scripted('ok', 'aborted')
    top, _, _ = tree(left, each)
    machine = Watched(top, name='TOP', settings={'nested': ['ALL/*'], 'max_recoveries': 1})
    assert machine.run() == 'done'
    assert [(event.path, event.state) for event in machine.of(EventKind.FAILURE)] == [
        ('TOP', 'BOTH'),
        ('TOP/ALL', 'EACH'),
    ]
    assert (left.runs, each.runs) == (2, 3)


def test_a_path_of_nested_that_stands_for_nothing_is_refused_with_those_there_are():
    said = r"'ARN' names nothing in SM_ROOT \(did you mean ARM\?\)"
    with pytest.raises(SettingsError, match=said):
        OracleContainer.wrap(tree()[0], settings={'nested': ['ARN']})
    with pytest.raises(SettingsError, match=r"nested: 'ARMS'.*ALL/EACH, ARM, ARM/HAND, BOTH/LEFT"):
        OracleContainer.wrap(tree()[0], settings={'nested': ['ARMS']})
    flat = smach.StateMachine(['ok'])
    with flat:
        smach.StateMachine.add('A', Scripted('ok'))
    with pytest.raises(SettingsError, match='Concurrences and Iterators: none'):
        OracleContainer.wrap(flat, settings={'nested': ['ARM']})
    with pytest.raises(SettingsError, match='true, false, or a list'):
        Settings.from_dict({'nested': 'ARM'})
