"""What the limits of a page's socket let through, and the list of trials that all pages share."""

import asyncio
import json
import threading
from types import SimpleNamespace

from smach_oracle.expert.console import page_socket
from smach_oracle.expert.console.commands.commands import CommandReply
from smach_oracle.expert.console.web.access import RateLimit, SocketRateLimits
from smach_oracle.expert.console.web.sections import PageSections


class Socket(page_socket.PageSocket):
    """One whose limits are used up."""

    _gone = False

    def __init__(self):
        self._pages = SimpleNamespace(teleoperation=SimpleNamespace(drives=lambda _: False))
        self._number = 1
        self._limits = SocketRateLimits(*[RateLimit(0.0, 0.0)] * 3)
        self.done = []

    def _at_once(self, command):
        self.done.append(command.name)
        return CommandReply(True)

    def end(self, code, why):
        self.done.append(code)


def test_a_stop_is_carried_out_before_the_socket_is_closed_for_too_many_commands():
    question, machine = {'question': 'q'}, {'robot': '/r', 'path': ''}
    for command, arguments, done in (
        ('stop_hand', question, ['stop_hand']),
        ('stop_machine', machine, ['stop_machine']),
        ('claim', question, []),
    ):
        socket = Socket()
        message = json.dumps(dict(arguments, id=1, do=command))
        asyncio.run(socket.on_message(message))
        assert socket.done == done + [page_socket.TOO_FAST]


def test_of_two_threads_that_write_the_list_of_trials_the_later_one_lasts():
    begun, opened = threading.Event(), threading.Event()

    class Log:
        version = 1

        def overview(self):
            version = self.version
            if version == 1:
                begun.set()
                assert opened.wait(20)
            return {'heard': version, 'trials': []}

    log, sections = Log(), PageSections()
    pages = page_socket.OpenPages(sections, log, None, None, None, None, None)
    socket = Socket()
    socket.lists = SimpleNamespace(looks=('trials', 'bags'))
    pages.sockets.add(socket)
    first = threading.Thread(target=pages.write_trials, daemon=True)
    first.start()
    assert begun.wait(20)
    log.version = 2
    second = threading.Thread(target=pages.write_trials, daemon=True)
    second.start()
    second.join(0.2)  # without a lock it is done by now
    opened.set()
    for thread in (first, second):
        thread.join(20)
    assert sections.get('trials')['heard'] == 2
