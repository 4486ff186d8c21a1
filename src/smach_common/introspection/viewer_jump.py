"""A hook: what controls a machine sends a running container where a viewer wants it.

The introspection knows nothing of who may do that: what has a hand on the machines says so here.
"""

from typing import Any, Callable, Collection, List, Optional

# container, label, userdata keys that come with it, who wants it. None means it is none of theirs,
# False (logged): it cannot go there
Sender = Callable[[Any, str, Collection[str], str], Optional[bool]]

_senders: List[Sender] = []


def add_sender(sender: Sender) -> None:
    """Ask this one, too, for each machine that a viewer wants elsewhere, or to begin elsewhere."""
    if sender not in _senders:
        _senders.append(sender)


def send_running(container: Any, label: str, written: Collection[str], by: str) -> Optional[bool]:
    """Have a machine that runs sent to a state. Return None where nobody takes that on.

    One that does not run will begin there. Whoever has a hand on it is asked about that, too.

    :param written: userdata keys that come with the command.
    :param by: who wants it.
    :returns: False where it cannot go there.
    """
    for sender in _senders:
        is_sent = sender(container, label, written, by)
        if is_sent is not None:
            return is_sent
    return None
