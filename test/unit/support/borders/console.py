"""Border of the console: the messages of its pages' sockets, and its cookies."""

import asyncio
import json
from types import SimpleNamespace
from typing import Any, Callable, Dict, List
from unittest import mock

import tornado.web
from hypothesis import strategies as st

from smach_oracle.expert.console import page_socket
from smach_oracle.expert.console.commands.commands import COMMANDS, CommandReply
from smach_oracle.expert.console.trials.trial_log import TrialLog
from smach_oracle.expert.console.web import sessions
from smach_oracle.expert.console.web.access import AccessTokens, RateLimit, SocketRateLimits
from smach_oracle.expert.console.web.handlers import SessionHandler
from smach_oracle.expert.console.web.sections import PageSections

from .border import REFUSED, TAKEN, Border, refused
from .json_texts import json_texts
from .values import mapping_of, numbers, plain, texts, words

_axes = st.lists(st.floats(-1, 1), min_size=3, max_size=3)
_points = st.lists(st.lists(st.floats(-9, 900), min_size=2, max_size=2), min_size=3, max_size=5)
_ARGUMENTS: Dict[str, Any] = {
    'question': words('q1'),
    'kind': words('goto', 'supersede'),
    'name': texts,
    'container': texts,
    'outputs': st.one_of(
        st.none(),
        st.lists(
            mapping_of({'key': words('grasped'), 'value': plain, 'type': texts}, ['key', 'value']),
            max_size=2,
        ),
    ),
    'why': texts,
    'seen': st.one_of(st.none(), numbers),
    'held': st.booleans(),
    'frame': words('tool', 'at_goal', 'fresh'),
    'linear': _axes,
    'angular': _axes,
    'gripper': words('', 'open'),
    'sent': st.floats(0, 1e6),
    'xsrf': words('right'),
    'expert': words('eva'),
    'trial': words('t'),
    'at': words('', 'trials'),
    'stamp': words('1.000000000', '4294967296.000000000'),
    'region': _points,
    'strokes': st.lists(
        mapping_of(
            {'foreground': st.booleans(), 'width': st.floats(1, 9), 'points': _points},
            ['foreground', 'width', 'points'],
        ),
        max_size=2,
    ),
    'outcome': words('succeeded'),
    'robot': words('/robot'),
    'robots': st.lists(words('/robot', '/other'), max_size=2),
    'path': words('', 'task'),
    'pattern': words('A'),
    'remove': st.booleans(),
    'arm': words('', 'left'),
    'down': words('robot.db#1'),
    'moment': st.integers(0, 9),
    'text': words('the gripper is worn'),
    'note': words('1.5-7'),
    'label': words('A', 'KITCHEN/LOOK'),
    'key': words('cups'),
    'json': st.one_of(json_texts, texts),
}


def _command(name: str) -> Any:
    fields = {field: _ARGUMENTS[field] for field in COMMANDS[name].checks}
    fields.update(id=st.integers(1, 9), do=st.just(name))
    return mapping_of(fields, sorted(fields))


# all of them at once: an argument that is missing above shows whatever is drawn
_commands = st.one_of([_command(name) for name in sorted(COMMANDS)]).map(json.dumps)
_messages = st.one_of(_commands, _commands, _commands, json_texts, st.binary(max_size=40))


class _Carried:
    """In place of what carries commands out: it hands each on as JSON."""

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return lambda *_: None

    def drives(self, page: int) -> bool:
        return False

    def drive(self, command: Any, *_: object) -> CommandReply:
        json.dumps(command.arguments['linear'], allow_nan=False)
        return CommandReply(True)

    stop = drive_anything = carry_out = lambda self, command, *_: CommandReply(True, command.name)


class _Hand(_Carried):
    async def stop(self, command: Any, *_: object) -> CommandReply:
        return CommandReply(True, 'asked')


class Socket(page_socket.PageSocket):
    """The socket of a page without a connection; what it says is kept."""

    _gone = False

    def __init__(self) -> None:
        self._access = mock.Mock()
        self._access.identity = lambda session: SimpleNamespace(role='teleoperator', name='')
        self._access.audit.record = lambda *told: json.dumps([str(each) for each in told])
        self._access.secret = 'secret'
        self.session = sessions.BrowserSession('id', 0.0, 'teleoperator')
        self.request = SimpleNamespace(remote_ip='127.0.0.1')
        carried = _Carried()
        with mock.patch.object(page_socket, 'ThreadPoolExecutor', mock.Mock()):
            pages = page_socket.OpenPages(
                PageSections(), TrialLog(), carried, carried, _Hand(), carried, carried
            )
        pages.workers = None  # of the loop
        self._prepare(pages)
        self.said: List[Any] = []

    def _prepare(self, pages: Any) -> None:
        with mock.patch.object(page_socket, 'access_of', lambda _: self._access):
            session = self.session
            self.initialize(pages)
            self.session = session
        self._limits = SocketRateLimits(*[RateLimit(1e6, 1e6)] * 3)

    def _send(self, text: str, done: Any = None) -> None:
        self.said.append(json.loads(text))

    def close(self, code: Any = None, reason: Any = None) -> None:
        self.said.append({'ok': False, 'message': reason})


def _take(message: Any) -> str:
    async def hear() -> List[Any]:
        page = Socket()
        right = sessions.xsrf_token(page.session, 'secret')
        await page.on_message(json.dumps({'id': 1, 'do': 'hello', 'xsrf': right, 'expert': 'eva'}))
        assert page.said.pop()['ok']
        await page.on_message(message)
        while page._tasks:
            await asyncio.gather(*page._tasks)
        return page.said

    said = asyncio.run(hear())
    if not said:
        return TAKEN  # of a hand that moves nothing is said
    return TAKEN if said[-1]['ok'] else refused(said[-1]['message'])


def _take_sign_in(text: str) -> str:
    body = text.encode('utf-8', 'surrogatepass')
    tokens = AccessTokens('operator operator-token-of-sufficient-length', 'tokens')
    handler = SimpleNamespace(
        request=SimpleNamespace(body=body),
        access=SimpleNamespace(settings=SimpleNamespace(tokens=tokens)),
    )
    handler._token = lambda: SessionHandler._token(handler)
    try:
        identity = SessionHandler._given(handler)
    except tornado.web.HTTPError as err:
        return refused(err, '400')
    return TAKEN if identity is not None else REFUSED


_tokens = words('operator-token-of-sufficient-length').map(
    lambda token: json.dumps({'token': token})
)
BORDERS = [
    Border('console socket', _messages, _take),
    Border('console sign-in', st.one_of(_tokens, json_texts), _take_sign_in),
]
