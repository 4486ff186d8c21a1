"""A stored trial, looked at and changed by hand."""

import contextlib
import json
import time
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from .codecs import Codecs, Encoded, NotStorable
from .errors import StoreError
from .holding import MachineLock
from .names import (
    ASKED,
    AT,
    BEFORE,
    EDIT,
    ENDED,
    FAILED,
    IN,
    ITEMS,
    KEPT,
    KEPT_OUT,
    KEY,
    MARK,
    MOVED,
    STATE,
    STRUCTURE,
)
from .renaming import containers_of, states_of
from .rows import Fact, NewMoment, StoredTrial, StoredValue, is_in_doubt
from .store_file import StoreFile

DROPPED = 'dropped'  # in place of the outcome of a trial that somebody has dropped
LONGEST = 200  # letters of a value that are shown
# what is raised where the content of a store is not what this program has written
DAMAGE = (ValueError, TypeError, LookupError, AttributeError, RecursionError)


class StoppedPlace(NamedTuple):
    """The place at which one container was stopped."""

    path: str
    label: str  # of the state. Of a container that has ended, its outcome
    phase: str
    text: str  # what it failed with, or the path of the state to which it was sent


class StoppedTrial:
    """One trial of a store. What is changed is a new moment, and those before it stay."""

    def __init__(self, store: StoreFile, trial: StoredTrial, until: Optional[int] = None) -> None:
        """`until`: the moment that is looked at. By default the last one."""
        self._store, self.trial = store, trial
        self._facts: Dict[Tuple[str, str], StoredValue] = {}
        self.latest = 0  # number of the moment that is looked at
        for fact in store.facts(trial.number, until):
            self.latest = fact.moment
            if fact.name:
                self._facts[fact.path, fact.name] = fact.value

    # -- what is there

    def places(self) -> List[StoppedPlace]:
        """Return where the containers stand that had begun, the outermost first.

        What is in a state counts only while that state is the one under way.
        """
        found = []
        for path, at in sorted(self._place_facts().items()):
            label, phase, text = str(at[0]), str(at[1]), ''
            if phase == FAILED:
                text = ' '.join(filter(None, map(str, at[3:5])))
            elif phase == BEFORE:
                text = str(at[2] or '') if len(at) > 2 else ''
            if phase != ENDED:
                path = self._state_path(path, label).rpartition('/')[0]
            found.append(StoppedPlace(path, label, phase, text))
        return found

    def items(self) -> Iterator[Tuple[str, int]]:
        """Yield path and number of the item of each Iterator that was under way."""
        standing = self._place_facts()
        for path, number in sorted(self._named(ITEMS)):
            if number and self._is_in_state_under_way(path, standing):
                yield path, int(number)

    def _place_facts(self) -> Dict[str, List[Any]]:
        """Return what tells where a container or a branch stands, by its path."""
        found: Dict[str, List[Any]] = {}
        for path, at in sorted(self._named(AT)):
            if not at or not self._is_in_state_under_way(path, found):
                continue
            if at[1] == MOVED:
                path, at = at[2].rpartition('/')[0], at[3]
            found[path] = at
        return found

    @staticmethod
    def _is_in_state_under_way(path: str, above: Mapping[str, List[Any]]) -> bool:
        around = path.rpartition('/')[0]
        while around and around not in above:
            around = around.rpartition('/')[0]
        if not around:
            return '/' not in path  # the top machine
        label, phase = above[around][:2]
        return phase == IN and (path + '/').startswith('{}/{}/'.format(around, label))

    def _state_path(self, path: str, label: str) -> str:
        """Return the path of a state of a container. Of a branch it is that of the branch."""
        containers = self.containers()
        return '{}/{}'.format(path, label) if path in containers or not containers else path

    def userdata(self) -> Iterator[Tuple[str, str, str]]:
        """Yield path, key and value as JSON, long ones cut, or why there is none."""
        for (path, name), value in sorted(self._facts.items()):
            if name.startswith(KEY) and value.is_there:
                yield path, name[len(KEY) :], self._text_of(value)
            elif name.startswith(KEPT_OUT) and value.is_there:
                kind, why = json.loads(value.text or '["", ""]')
                yield path, name[len(KEPT_OUT) :], '({}, not stored: {})'.format(kind, why)

    def keys(self, path: str) -> List[str]:
        """Return the userdata keys of a container, also of values that could not be stored."""
        return sorted(
            {
                name[len(word) :]
                for (of, name), value in self._facts.items()
                for word in (KEY, KEPT_OUT)
                if of == path and name.startswith(word) and value.is_there
            }
        )

    def is_under_way(self, path: str) -> bool:
        """Whether a container was under way. Any other one gets its input keys as it begins."""
        return self._is_in_state_under_way(path, self._place_facts())

    def is_kept(self) -> bool:
        """Whether its program ended as nobody had said how it goes on."""
        return self._last_kind() == KEPT

    def is_broken(self) -> bool:
        """Whether states may have run that are not stored, and nobody has answered since."""
        return is_in_doubt(self._store.moments(self.trial.number))

    def _last_kind(self) -> str:
        moments = self._store.moments(self.trial.number)
        return moments[-1].kind if moments else ''

    def questions(self) -> Iterator[Tuple[str, str]]:
        """Yield path of the state and id of each question that was open.

        One that was answered by an interface is not, though it is asked again if that has not done
        the work.
        """
        for path, asked in sorted(self._named(ASKED)):
            if asked and asked[1]:
                yield self._state_path(path, asked[0]), str(asked[1])

    def recoveries(self) -> Iterator[Tuple[str, int]]:
        """Yield path of the state and number of its recoveries, where there were any."""
        for (path, name), value in sorted(self._facts.items()):
            if name.startswith(STATE) and value.is_there:
                count = json.loads(value.text or '{}').get('counts', [0, 0])[1]
                if count:
                    yield self._state_path(path, name[len(STATE) :]), int(count)

    def containers(self) -> List[str]:
        """Return the paths of all containers, the top machine's name first in each."""
        top = self.trial.machine
        return [top + ('/' + path if path else '') for path in containers_of(self._structure())]

    def states(self) -> List[str]:
        """Return the paths of all states, below the top machine: where it can go on."""
        return states_of(self._structure())

    def _named(self, name: str) -> Iterator[Tuple[str, Any]]:
        for (path, each), value in self._facts.items():
            if each == name and value.is_there:
                yield path, json.loads(value.text or 'null')

    def _text_of(self, value: StoredValue) -> str:
        text = value.text
        if text is None and value.whole is not None:
            text = self._store.part(value.whole).decode('ascii', 'replace')
        text = text or ''
        return (
            text if len(text) <= LONGEST else '{}... ({} letters)'.format(text[:LONGEST], len(text))
        )

    # -- changing it

    def edit(self, key: str, json_text: str, path: str, who: str) -> None:
        """Give a userdata key of a container another value.

        :param json_text: plain JSON. What it means for the script is the user's business.
        :param path: of the container.
        :raises StoreError: for what is no JSON, a container that is not stored, a trial that has
            ended, has gone on since it was looked at, or whose machine a process holds, and where
            it cannot be written.
        """
        if path not in self.containers():
            raise StoreError(
                'there is no container {!r}; there are {}'.format(
                    path, ', '.join(sorted(self.containers()))
                )
            )
        try:
            encoded = Codecs().encode(json.loads(json_text))
        except (ValueError, RecursionError, NotStorable) as err:
            raise StoreError(
                '{}: {!r} is no JSON ({}); a text needs quotes'.format(key, json_text, err)
            ) from err
        facts = [Fact(path, KEY + key, encoded)]
        if (path, KEPT_OUT + key) in self._facts:
            facts.append(Fact(path, KEPT_OUT + key, None))
        self._commit(path, '', facts, who, '{}: {} = {}'.format(path, key, json_text))

    def guarded(self) -> Dict[str, str]:
        """Return the states that have begun and are not repeated by themselves, with on_retry.

        By their paths below the top machine.
        """
        top, found = self.trial.machine, {}
        for (path, name), value in sorted(self._facts.items()):
            if name.startswith(MARK) and value.is_there:
                done, _, on_retry = (*json.loads(value.text or '[]'), 'allow')[2:5]
                if done and on_retry != 'allow':
                    found[self._state_path(path, name[len(MARK) :])[len(top) + 1 :]] = on_retry
        return found

    def go_to(self, label: str, who: str, repeat: Sequence[str] = ()) -> None:
        """Let the machine go on at another state.

        :param label: of the top machine, or the path of a state below it.
        :param repeat: states that may be repeated once for that, whatever their on_retry says.
        :raises StoreError: as `edit`, where there is no such state, and where it, or one on the way
            down to it, is not repeated by itself.
        """
        top, states = self.trial.machine, self.states()
        for each in (label, *repeat):
            if each not in states:
                raise StoreError(
                    'there is no state {!r}; there are {}'.format(each, ', '.join(sorted(states)))
                )
        for each, on_retry in self.guarded().items():
            if (label + '/').startswith(each + '/') and each not in repeat:
                raise StoreError(
                    '{0} was done in this trial, and is not repeated by itself (on_retry: {1}). '
                    '`oracle_state {2} goto {3} --repeat {0}` sends the machine there '
                    'anyway'.format(each, on_retry, self._store.path, label)
                )
        first, _, below = label.partition('/')
        at: List[Any] = [first, BEFORE, '{}/{}'.format(top, label) if below else None, list(repeat)]
        facts = [Fact(top, AT, Encoded(json.dumps(at), None, {}))]  # also a long path as text
        facts += (Fact(path, ASKED, None) for path, _ in self._named(ASKED))
        self._commit(
            top,
            first,
            facts,
            who,
            'go to {}{}'.format(label, ''.join(', and repeat ' + each for each in repeat)),
        )

    def drop(self, who: str) -> None:
        """End the trial, so that it is never resumed.

        :raises StoreError: as `edit`.
        """
        lock = self._held()
        try:
            self._store.drop(self.trial.number, time.time(), DROPPED, who)
        finally:
            lock.release()

    def _commit(self, path: str, label: str, facts: List[Fact], who: str, what: str) -> None:
        lock = self._held()
        try:
            moments = self._store.moments(self.trial.number)
            seq = max((moment.seq for moment in moments), default=-1)
            self._store.edit(
                self.trial.number,
                NewMoment(time.time(), seq, EDIT, path, label, tuple(facts)),
                who,
                'trial {}: {}'.format(self.trial.number, what),
            )
        finally:
            lock.release()

    def _held(self) -> MachineLock:
        """Hold the machine, so that no program begins while it is changed."""
        if self.trial.ended is not None:
            raise StoreError(
                'trial {} has ended ({}), and is never resumed'.format(
                    self.trial.number, self.trial.outcome
                )
            )
        lock = MachineLock(self._store.path, self.trial.machine)
        lock.take()
        try:
            self._check_as_seen()
        except BaseException:
            lock.release()
            raise
        return lock

    def _check_as_seen(self) -> None:
        """Nobody but who holds the machine changes it, so this is true until it is let go."""
        number = self.trial.number
        now = [each for each in self._store.trials(self.trial.machine) if each.number == number]
        latest = max((each.number for each in self._store.moments(number)), default=0)
        if not now or now[0].ended is not None or latest != self.latest:
            raise StoreError(
                'trial {} has gone on, was changed or has ended since it was looked '
                'at: look at it again'.format(number)
            )

    def _structure(self) -> str:
        latest = self._facts.get(('', STRUCTURE))
        return self._store.description(
            self.trial.structure if latest is None else json.loads(latest.text or '""')
        )


@contextlib.contextmanager
def trial_to_change(
    path: str, number: Optional[int] = None, seen: Optional[int] = None
) -> Iterator[StoppedTrial]:
    """Yield a trial of the store at `path`, for one change.

    :param number: of the trial, by default the latest one that has not ended.
    :param seen: the latest moment that who changes it has seen, by default what is there now.
    :raises StoreError: where there is no such store or trial, or the store is damaged, and what
        the body raises.
    """
    StoreFile(path, read_only=True).close()  # a store is not made by looking for it
    store = StoreFile(path)
    try:
        stopped = StoppedTrial(store, chosen_trial(store, number))
        if seen is not None:
            stopped.latest = seen
        yield stopped
    except DAMAGE as err:
        raise StoreError('{}: is damaged: {!r}'.format(path, err)) from err
    finally:
        store.close()


def chosen_trial(store: StoreFile, number: Optional[int]) -> StoredTrial:
    """Return a trial by its number. None means the latest one that has not ended, else the latest.

    :raises StoreError: where there is no such trial.
    """
    trials = store.trials()
    if number is None:
        trials = [trial for trial in trials if trial.ended is None] or trials
    else:
        trials = [trial for trial in trials if trial.number == number]
    if not trials:
        raise StoreError(
            '{}: there is no {}'.format(
                store.path, 'trial' if number is None else 'trial {}'.format(number)
            )
        )
    return trials[-1]


def in_words(standing: StoppedPlace) -> str:
    """Return where a container stands, as a sentence."""
    if standing.phase == ENDED:
        return '{} had ended with {}'.format(standing.path, standing.label)
    if standing.phase == FAILED:
        return '{}/{} had failed: {}'.format(standing.path, standing.label, standing.text)
    if standing.phase == BEFORE:
        return '{}/{} was next{}'.format(
            standing.path, standing.label, standing.text and (', on the way to ' + standing.text)
        )
    return '{}/{} was under way'.format(standing.path, standing.label)


def innermost(places: List[StoppedPlace]) -> List[StoppedPlace]:
    """Return those in which nothing else stands: the states under way, one of each branch."""
    going = [each for each in places if each.phase != ENDED]
    return [
        each
        for each in going
        if not any(
            '{}/'.format(other.path).startswith('{}/{}/'.format(each.path, each.label))
            for other in going
        )
    ] or places[-1:]
