"""The end of a trial says whether the trial may be resumed."""

import pytest
from machines import Scripted, chain_of

from smach_oracle.oracle import OracleContainer
from smach_oracle.oracle.records.events import EventKind


@pytest.mark.parametrize('is_stored', [False, True])
@pytest.mark.parametrize('end', ['ok', KeyboardInterrupt(), RuntimeError()])
def test_a_stored_trial_that_was_stopped_says_that_it_can_go_on(tmp_path, is_stored, end):
    settings = {'checkpoint': str(tmp_path / 'store.db')} if is_stored else {}
    machine, events = chain_of(Scripted(end)), []
    OracleContainer.wrap(machine, settings=settings, recover=False)
    machine.events.observers.append(events.append)
    try:
        machine.execute()
    except BaseException as err:
        assert end != 'ok', err
    (told,) = [event.data for event in events if event.kind is EventKind.TRIAL_END]
    may_be_resumed = is_stored and isinstance(end, KeyboardInterrupt)
    assert told.get('can_go_on', False) is may_be_resumed
