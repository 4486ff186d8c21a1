"""A trial counts once for `learn` and `compare what_if`, whatever number of bags it is in."""

import shutil

import pytest
from failing_machines import KEPT, record, run
from resumed_trial import record_resumed_trial

from smach_oracle.analysis import what_if
from smach_oracle.analysis.learning import command
from smach_oracle.oracle.records.events import EventKind


def learned(capsys, folder, code=0):
    """The first line of `learn`, and what it says on standard error."""
    capsys.readouterr()
    assert command.main([str(folder)]) == code
    out, err = capsys.readouterr()
    return out.partition('\n')[0], err


def tried(capsys, folder, code=0):
    """The folder, the decisions and the trials that `what_if` tells, and its standard error."""
    capsys.readouterr()
    assert what_if.main([str(folder), '--policy', 'retry']) == code
    out, err = capsys.readouterr()
    rows = [line.split() for line in out.splitlines() if line.startswith('policy retry ')]
    return [(int(row[2]), int(row[-1])) for row in rows], err


def test_a_trial_that_went_on_in_another_bag_teaches_all_that_happened_in_it(tmp_path, capsys):
    resumed = record_resumed_trial(tmp_path)
    told = '# TOP: 1 trials, 2 results of ways from failures of 2 states'
    assert learned(capsys, resumed) == (told, '')
    assert command.main([str(resumed), '--explain', 'PLACE']) == 0
    assert 'PLACE, aborted: entering again 1 of 1' in capsys.readouterr().out
    # GRASP and PLACE failed, and CARRY was interrupted
    assert tried(capsys, resumed) == ([(3, 1)], '')


@pytest.mark.parametrize('copies', ['backup', '.', '../another'])
def test_a_bag_that_is_there_twice_counts_once(tmp_path, capsys, copies):
    record(tmp_path / 'bags', run(20, **{**KEPT, 'policy': 'escalating'}))
    first = learned(capsys, tmp_path), tried(capsys, tmp_path)
    for bag in sorted((tmp_path / 'bags').glob('*.bag')):
        copy = tmp_path / 'bags' / copies / '{} (copy).bag'.format(bag.stem)
        copy.parent.mkdir(exist_ok=True)
        shutil.copy(str(bag), str(copy))
    ((decisions, trials),), err = tried(capsys, tmp_path)
    assert decisions > 10 and trials == 20 and not err
    assert (learned(capsys, tmp_path), tried(capsys, tmp_path)) == first


@pytest.mark.parametrize('kind', [EventKind.TRIAL_START, EventKind.STATE_START])
def test_a_trial_that_lacks_an_event_is_named_and_the_others_count(tmp_path, capsys, kind):
    trials = run(20, **{**KEPT, 'policy': 'escalating'})
    lacking = trials.pop()
    lacking.remove(next(event for event in lacking if event.kind is kind))
    record(tmp_path, [*trials, lacking])
    name = 'Skipped {}: trial {}: 1 of its events is lost'.format(
        next(tmp_path.glob('*{}.bag'.format(lacking[0].trial_id))), lacking[0].trial_id
    )
    line, err = learned(capsys, tmp_path, 1)
    assert line.startswith('# TOP: 19 trials, ') and err.startswith(name)
    rows, err = tried(capsys, tmp_path, 1)
    assert rows[0][1] == 19 and err.startswith(name)


def test_a_trial_that_lost_events_between_two_bags_is_named_once(tmp_path, capsys):
    *trials, long = run(20, **{**KEPT, 'policy': 'escalating'})
    record(tmp_path, [*trials, long[:4]])
    record(tmp_path, [long[6:]])
    line, err = learned(capsys, tmp_path, 1)
    assert line.startswith('# TOP: 19 trials, ')
    assert err.count('Skipped') == 1 and ': 2 of its events are lost' in err


def test_a_trial_without_an_oracle_is_none_that_was_skipped(tmp_path, capsys):
    trials = run(4, **{**KEPT, 'policy': 'escalating'})
    bare = [event for event in trials.pop() if event.kind is not EventKind.DECISION]
    bare[0] = bare[0]._replace(data={'recovers': False})
    record(tmp_path, [*trials, bare[:2] + bare[3:]])
    assert learned(capsys, tmp_path)[0].startswith('# TOP: 3 trials, ')
