"""Work in a copy of this process, for tests that begin where the same long way has led."""

import os
import pickle
import traceback


def in_a_fork(work):
    """Do `work()` in a forked process: what it changes in memory is not changed here.

    :returns: what it returns, which can be pickled.
    :raises AssertionError: where it raises, with its traceback.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        told, answer = 'it was left', None
        try:
            os.close(reader)
            answer = work()
            told = ''
        except BaseException:
            told = traceback.format_exc()
        finally:
            with os.fdopen(writer, 'wb') as stream:
                pickle.dump((told, answer), stream)
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, 'rb') as stream:
        sent = stream.read()
    _, status = os.waitpid(child, 0)
    assert status == 0, 'it has ended with the status {}'.format(status)
    told, answer = pickle.loads(sent)
    assert not told, told
    return answer
