"""Work in a copy of this process, for tests that begin where the same long way has led."""

import functools
import os
import pickle
import traceback


class Fork:
    """A copy of this process, which goes on from where it is made."""

    def __init__(self):
        self._reader, self._writer = os.pipe()
        self._child = os.fork()
        self.inside = not self._child  # whether this is the copy
        os.close(self._reader if self.inside else self._writer)
        self._sent = None

    def end_with(self, work):
        """In the copy: do `work()`, as its last."""
        told, answer = 'it was left', None
        try:
            answer = work()
            told = ''
        except BaseException:
            told = traceback.format_exc()
        finally:
            with os.fdopen(self._writer, 'wb') as stream:
                pickle.dump((told, answer), stream)
            os._exit(0)

    def wait(self):
        """Until the copy has ended."""
        with os.fdopen(self._reader, 'rb') as stream:
            self._sent = stream.read()
        _, status = os.waitpid(self._child, 0)
        assert status == 0, 'it has ended with the status {}'.format(status)

    def answer(self):
        """What the work of the copy has returned, which can be pickled.

        :raises AssertionError: where it raised, with its traceback.
        """
        told, answer = pickle.loads(self._sent)
        assert not told, told
        return answer


def in_a_fork(work):
    """Do `work()` in a forked process: what it changes in memory is not changed here.

    :returns: what it returns, which can be pickled.
    :raises AssertionError: where it raises, with its traceback.
    """
    fork = Fork()
    if fork.inside:
        fork.end_with(work)
    fork.wait()
    return fork.answer()


def in_own_fork(test):
    """A test that is done in a fork: what it changes in a world stays hidden from the others."""

    @functools.wraps(test)
    def forked(**given):
        in_a_fork(lambda: test(**given))

    return forked
