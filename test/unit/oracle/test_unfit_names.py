"""All names in settings that fit nothing in a tree, in the words in which they are refused.

test/data/pinned/unfit_names.txt holds them.
"""

import pytest
from branch_machines import Item, iterator_over
from guarded_machines import both, chain
from machines import Scripted
from pinned import held

import smach
from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.errors import SettingsError

UNFIT = {
    'states': {
        'LOK': {'prior': 0.5, 'failure_outcomes': ['los']},
        'LOO*': {'failure_outcomes': ['los']},
        'ARM/HOLD': {'failure_outcomes': ['los']},
        'ARM/GRAP': {'time_limit_s': 3},
        'GRASP': {
            'failure_outcomes': ['los', 'aborted'],
            'preconditions': ['LOOK', 'GRASP', 'NONE', 'ARM', 'BOTH/RIGHT', 'ARM/HOLD', 'HOLD'],
        },
        'LOOK': {'intended_outcomes': ['lost', 'aborted'], 'preconditions': ['LOOK', 'ARM']},
        '**/NO': {'on_retry': 'never'},
        '*/GRASP': {'prior': 0.3},
        'BOTH/RIGHT': {'preconditions': ['LOOK', 'LEFT', 'ARM/GRASP']},
        'RIGHT': {'preconditions': ['LEFT']},
    },
    'failure_outcomes': ['lost', 'done', 'burnt'],
    'intended_outcomes': ['picked'],
    'on_no_answer': {'goto': '/HOME/'},
    'on_resume': 'state:NOWHERE',
    'resume_map': {'OLD': 'NEW', 'A': 'LOOK'},
    'interfaces': {'hand': {'action': 'x', 'states': ['GRASP', 'HAND']}},
}


def tree():
    return chain(
        LOOK=Scripted(outcomes=('ok', 'lost')),
        ARM=chain(GRASP=Scripted(), HOLD=Scripted()),
        BOTH=both(LEFT=chain(L=Scripted()), RIGHT=Scripted()),
        ALL=iterator_over(Item(), items=(1,)),
    )


def unfit_in(machine, settings):
    found = []
    OracleContainer.wrap(machine, settings=settings, name='TOP', strict=found.append)
    return ['{:12} {}: {}'.format(each.kind.name, each.name, each.error) for each in found]


def test_each_name_that_fits_nothing_is_refused_in_the_same_words_as_ever():
    found = unfit_in(tree(), UNFIT)
    found += unfit_in(tree(), {**UNFIT, 'nested': ['ARM', 'ARN', '**/LEFT']})
    found += unfit_in(chain(A=Scripted()), {'nested': ['A'], 'on_no_answer': {'give_up': 'dne'}})
    assert found == held('unfit_names')


@pytest.mark.parametrize('key', ['failure_outcomes', 'resume_map', 'on_no_answer', 'on_resume'])
@pytest.mark.parametrize('strict', [True, False])
def test_what_is_looked_at_later_or_may_be_meant_for_others_stops_no_wrap(key, strict, log):
    OracleContainer.wrap(tree(), settings={key: UNFIT[key]}, strict=strict)
    assert not [text for level, text in log if level == 'warn']


@pytest.mark.parametrize('states', [{'LOK': {'prior': 0.5}}, {'LOOK': {'preconditions': ['ARN']}}])
def test_a_name_of_no_state_stops_a_wrap_where_that_is_strict_and_is_logged_else(states, log):
    with pytest.raises(SettingsError):
        OracleContainer.wrap(tree(), settings={'states': states})
    log.clear()
    OracleContainer.wrap(tree(), settings={'states': states}, strict=False)
    assert len([text for level, text in log if level == 'warn']) == 1


class Duck:
    """Has all that a state has, but is not made from one."""

    def __init__(self):
        self._state = Scripted()

    def __getattr__(self, name):
        return getattr(self._state, name)


def test_what_is_no_state_has_no_oracle_that_could_be_named():
    tree = chain(BOTH=both(DUCK=Duck(), BIRD=Scripted()))
    found = unfit_in(tree, {'nested': ['BOTH/DUCK', 'BOTH/BIRD']})
    assert len(found) == 1 and 'BOTH/DUCK' in found[0]


def test_names_are_looked_at_again_once_a_state_has_come_and_not_before(log):
    def warned():
        return sum(level == 'warn' and 'is no state' in text for level, text in log)

    settings = {'states': {'NOWHERE': {'memory': 5}}}
    machine = OracleContainer.wrap(chain(A=Scripted()), settings=settings, strict=False)
    counts = [warned()]
    for label in ('', 'LATER'):
        if label:
            with machine:
                smach.StateMachine.add(label, Scripted(), {'ok': 'done'})
        machine.execute()
        machine.execute()
        counts.append(warned())
    assert counts == [1, 1, 2]
