"""What is told of branches: their rows of counts and rates, their prospects, questions about them.

Files in test/data/pinned hold it, the same for each engine.
"""

from branch_machines import Item, iterator_over
from machines import FakeExpert, Scripted, Watched, goto, supersede
from pinned import held
from pinned_scenes import ASKS, both, chain, each

from smach_oracle.oracle.prospects import prospects_of


def tree():
    """A Concurrence of a state and an Iterator, and an Iterator of a Concurrence."""
    return chain(
        LOOK=Scripted(),
        BOTH=both(Scripted('aborted'), each(Scripted('ok', 'aborted'), 'ok')),
        ALL=each(both(Scripted(), Scripted('aborted')), 'done'),
        END=Scripted(),
    )


def rows_of(machine):
    """Each row of the counts and of the rates."""
    counted = [
        'count {}/{} ({}) > {}: {}'.format(row.path, row.state, row.outcome, row.to, row.count)
        for row in machine.transition_counts()
    ]
    learned = [
        'rate {}/{} {:.3f}: {} of {} failed'.format(
            row.path, row.state, row.rate, row.failures, row.failures + row.successes
        )
        for row in machine.rates()
    ]
    return sorted(counted) + sorted(learned)


def lines_of(prospect):
    """The lines of a container's prospect."""
    yield '{}: {} begins with {}, ends with {}{}{}'.format(
        prospect.path,
        type(prospect.machine).__name__,
        prospect.initial,
        ', '.join(prospect.outcomes),
        ', has branches' if prospect.has_branches else '',
        ', guarded ' + ', '.join(prospect.guarded) if prospect.guarded else '',
    )
    for state in prospect.states:
        for told in state.outcomes:
            words = [name for name in ('is_failure', 'author_recovers') if getattr(told, name)]
            yield '  {} ({}) > {} {}'.format(
                state.label, told.outcome, told.route.target, ' '.join(words)
            ).rstrip()


def asked(question):
    """What an expert is shown of a failure."""
    yield '{}/{} ({})'.format(
        question.container_path, question.failed_state, question.outcome or question.text
    )
    for choice in question.choices:
        yield '  goto {}/{}{}'.format(
            choice.container or question.container_path,
            choice.state,
            ' runs again ' + ', '.join(choice.runs_again) if choice.runs_again else '',
        )
    for offered in question.supersede_outcomes:
        yield '  supersede {}: {}'.format(offered.outcome, offered.target)
    yield '  give up {}'.format(', '.join(question.give_up_outcomes))
    yield '  keys {}'.format(', '.join(sorted(question.userdata)))


def test_the_counts_and_the_rates_have_the_same_rows_as_ever():
    machine = Watched(tree(), name='TOP')
    assert machine.run() == 'done'
    assert rows_of(machine.machine) == held('branches/rows')


def test_the_prospects_are_the_same_as_ever():
    machine = Watched(
        tree(), name='TOP', settings={'states': {'ALL/EACH/LEFT': {'on_retry': 'confirm'}}}
    )
    found = [line for prospect in prospects_of(machine.machine) for line in lines_of(prospect)]
    assert found == held('branches/prospects')


def test_the_questions_are_the_same_as_ever():
    """About a branch of BOTH, about an item, about a branch in an item, about what comes behind."""
    expert = FakeExpert(goto('LEFT'), goto('EACH'), supersede('ok'), goto('BOTH'), goto('END'))
    iterator = iterator_over(Item(item2=['aborted']), items=(1, 2))
    machine = Watched(
        chain(BOTH=both(Scripted('aborted'), Scripted()), ALL=iterator, END=Scripted('aborted')),
        name='TOP',
        expert=expert,
        settings=ASKS,
    )
    machine.machine.userdata.done = []
    machine.run()
    found = [line for question in expert.questions for line in asked(question)]
    assert found == held('branches/questions')


def test_userdata_at_each_try_of_an_item_is_the_same_as_ever():
    """It is restored at a revisit, and the finished items stay when the Iterator goes on."""
    seen = []

    def fails(state, ud):
        seen.append('fails at {} with {} and {}'.format(ud.item, ud.done, ud.note))
        ud.note = ud.note + '!'
        return 'aborted'

    def works(state, ud):
        seen.append('works at {} with {} and {}'.format(ud.item, ud.done, ud.note))
        ud.note = ud.note + '.'
        return 'ok'

    item = Item(item1=[works], item2=[fails, fails, works], item3=[works])
    item.register_io_keys(['note'])
    iterator = iterator_over(item, items=(1, 2, 3))
    iterator.register_input_keys(['note'])
    iterator.register_output_keys(['note'])
    for userdata in ('restore', 'keep'):
        item.scripts = {
            'item1': [works],
            'item2': [fails, fails, works],
            'item3': [works],
        }
        machine = Watched(
            chain(LOOK=Scripted(), ALL=iterator),
            name='TOP',
            expert=FakeExpert(goto('EACH'), goto('LOOK', container='TOP')),
            settings=dict(ASKS, userdata=userdata),
        )
        machine.machine.userdata.done, machine.machine.userdata.note = [], 'n'
        outcome = machine.run()
        seen.append('{}: {} {}'.format(userdata, outcome, dict(machine.machine.userdata._data)))
    assert seen == held('branches/userdata')
