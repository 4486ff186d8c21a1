"""A ROS master for one test."""

import xmlrpc.client

from waiting import wait_for


def master_answers(uri: str) -> bool:
    """Whether a master answers at this address, such as http://localhost:11311."""
    try:
        return bool(xmlrpc.client.ServerProxy(uri).getPid('/test')[0] == 1)
    except OSError:
        return False


def wait_for_master(uri: str) -> None:
    """Return when a master answers at this address.

    :raises RuntimeError: where none does within 60 s.
    """
    if not wait_for(lambda: master_answers(uri), 60.0):
        raise RuntimeError('no master came up at ' + uri)
