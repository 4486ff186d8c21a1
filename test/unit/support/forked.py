"""Work in a copy of this process, for tests that begin where the same long way has led."""

import os
import traceback


def in_a_fork(work):
    """Do `work()` in a forked process: what it changes in memory is not changed here.

    :raises AssertionError: where it raises, with its traceback.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        told = 'it was left'
        try:
            os.close(reader)
            work()
            told = ''
        except BaseException:
            told = traceback.format_exc()
        finally:
            os.write(writer, told.encode('utf-8', 'replace')[-60000:])
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader, 'rb') as stream:
        told = stream.read().decode('utf-8', 'replace')
    _, status = os.waitpid(child, 0)
    assert status == 0, 'it has ended with the status {}'.format(status)
    assert not told, told
