"""A command for several machines of a node: one that hangs delays none of the others."""

import threading
import time
from typing import Callable, List, Sequence, Tuple

from smach_oracle.oracle.errors import OperatorError
from smach_oracle.oracle.operator_hand import OperatorHand

ANSWER_LIMIT_S = 3.0  # front ends wait 5 s for a service

Command = Callable[[OperatorHand], str]


class _Commanded(threading.Thread):
    """One machine, commanded in a thread of its own."""

    def __init__(self, path: str, hand: OperatorHand, command: Command) -> None:
        super().__init__(name='command {}'.format(path), daemon=True)
        self.path = path
        self._hand = hand
        self._command = command
        self.told: List[str] = []
        self.refused: List[str] = []
        self.start()

    def run(self) -> None:
        """Give the command. What it raises is a refusal."""
        try:
            self.told.append(self._command(self._hand))
        except OperatorError as err:
            self.refused.append(str(err))
        except Exception as err:  # it is the user's machine
            self.refused.append('{}: {!r}'.format(self.path, err))


def command_all(
    meant: Sequence[Tuple[str, OperatorHand]], command: Command
) -> Tuple[List[str], List[str]]:
    """Command all of them at the same time.

    :param meant: machines, each with its path.
    :returns: what those say that have obeyed, with who has not answered within 3 s, and why the
        others have not. Where none has obeyed, who has not answered is among the refused.
    """
    deadline_s = time.monotonic() + ANSWER_LIMIT_S
    commanded = [_Commanded(path, hand, command) for path, hand in meant]
    for each in commanded:
        each.join(max(0.0, deadline_s - time.monotonic()))
    silent = [
        '{} has not answered yet'.format(each.path)
        for each in commanded
        if not each.told and not each.refused
    ]
    told = [text for each in commanded for text in each.told]
    refused = [text for each in commanded for text in each.refused]
    return (told + silent, refused) if told else ([], refused + silent)
