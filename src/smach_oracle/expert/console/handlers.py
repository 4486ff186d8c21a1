"""What the web server answers: the page, the session, the socket. Every request passes the same gate first."""
import json
import time
from typing import Any, Callable, Dict, NamedTuple, Optional

import tornado.web

from . import sessions
from .access import Bucket, Buckets, Identity
from .audit import Audit, Person
from .sessions import Session
from .settings import ConsoleSettings

POLICY = '; '.join([
    "default-src 'none'", "script-src 'self'", "style-src 'self'", "img-src 'self' blob:", "connect-src 'self'",
    "manifest-src 'self'", "base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'",
    "require-trusted-types-for 'script'", "trusted-types 'none'"])
HEADERS = {
    'Content-Security-Policy': POLICY, 'X-Content-Type-Options': 'nosniff', 'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer', 'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin', 'Cache-Control': 'no-cache',
    'Permissions-Policy': 'camera=(), microphone=(), geolocation=()'}
LONGEST_BODY = 4096


class Gate:
    """What all handlers share: settings, limits, and the keys of the cookie."""

    def __init__(self, settings: ConsoleSettings, secret: str, audit: Audit) -> None:
        self.settings = settings
        self.secret = secret
        self.audit = audit
        self.cookie = 'console_{}'.format(settings.port)
        self.requests = Buckets(rate=30.0, burst=150.0, for_all=5.0)
        self.files = Buckets(rate=100.0, burst=1000.0, for_all=5.0)  # a page is some 45; a browser may open many
        self.sign_ins = Buckets(rate=0.2, burst=5.0, for_all=4.0)
        self._ended: Dict[str, float] = {}  # id of a session -> when, s; of those whose cookie might still be good

    def session(self, handler: tornado.web.RequestHandler) -> Optional[Session]:
        """The session of a request's cookie; None where it has none of ours."""
        session = sessions.from_text(handler.get_secure_cookie(self.cookie, max_age_days=sessions.HOURS / 24.0))
        return None if session is None or session.id in self._ended or session.left_s <= 0.0 else session

    def end(self, session: Session) -> None:
        """Its cookie, of which somebody may have a copy, is good for nothing any more."""
        now_s = time.monotonic()
        self._ended = {id_: at_s for id_, at_s in self._ended.items() if now_s - at_s < 3600.0 * sessions.HOURS}
        self._ended[session.id] = now_s

    def identity(self, session: Optional[Session]) -> Optional[Identity]:
        """Who a session speaks for; None before signing in, after signing out, and where it has become too old.

        Without tokens whoever gets here may do everything, for as long as the page is open.
        """
        if session is not None and session.id in self._ended:
            return None
        if self.settings.tokens is None:
            return Identity('teleoperator') if session else None
        signed_in = session is not None and session.role and session.left_s > 0.0
        return Identity(session.role, session.name) if session and signed_in else None

    def refusal(self, handler: tornado.web.RequestHandler, limits: Optional[Buckets] = None) -> int:
        """The status with which a request is refused; 0 where it may go on. `limits`: of its own, where it has any."""
        request = handler.request
        if not self.settings.hosts.allows(request.headers.get('Host', '')):
            return 421
        if not (limits or self.requests).take(request.remote_ip or ''):
            return 429
        if not self.from_own_page(handler, must_say=request.method not in ('GET', 'HEAD')):
            return 403
        return 0

    def from_own_page(self, handler: tornado.web.RequestHandler, must_say: bool) -> bool:
        """Whether the Origin is this console; `must_say`: a request without one is refused, too."""
        headers = handler.request.headers
        origin = headers.get('Origin')
        if origin is None:
            return not must_say
        return self.settings.hosts.allows_origin(origin, headers.get('Host', ''), self.settings.scheme)


class Guarded(tornado.web.RequestHandler):
    """A handler behind the gate."""

    gate: Gate

    def initialize(self, gate: Gate, **_: Any) -> None:
        """Called by Tornado."""
        self.gate = gate

    def set_default_headers(self) -> None:
        """On every answer, errors among them."""
        guard(self)

    def prepare(self) -> None:
        """Before anything else."""
        status = self.gate.refusal(self)
        if status:
            raise tornado.web.HTTPError(status)

    def check_xsrf_cookie(self) -> None:
        """Our own check is in `demand_xsrf`."""

    def demand_xsrf(self, session: Optional[Session]) -> Session:
        """The session, of a request that knows its token; any other is answered with 403."""
        given = self.request.headers.get('X-Xsrf', '')
        if session is None or not sessions.same(given, sessions.xsrf_token(session, self.gate.secret)):
            raise tornado.web.HTTPError(403)
        return session

    def write_error(self, status_code: int, **_: Any) -> None:
        """The status alone: nothing of the request comes back."""
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish('{} {}\n'.format(status_code, self._reason))


class ForPages(Guarded):
    """A handler for pages of ours, of people who are signed in; with limits of its own, those of its room."""

    def initialize(self, gate: Gate, room: Any, **_: Any) -> None:  # type: ignore[override]
        """Called by Tornado. `room`: what its requests share, `limits: Buckets` among it."""
        super().initialize(gate)
        self._room = room

    def prepare(self) -> None:
        """The gate; then who it is, and that a page of ours asks."""
        status = self.gate.refusal(self, self._room.limits)
        if status:
            raise tornado.web.HTTPError(status)
        session = self.gate.session(self)
        if self.gate.identity(session) is None:
            raise tornado.web.HTTPError(401)
        self.demand_xsrf(session)
        self.set_header('Cache-Control', 'no-store')

    def tell_why(self, err: Exception) -> None:
        """What was asked for cannot be shown."""
        self.set_status(422)
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish(str(err)[:500])


class NotThere(Guarded):
    """Everything else."""

    def prepare(self) -> None:
        """After the gate."""
        super().prepare()
        raise tornado.web.HTTPError(404)


class StaticFile(tornado.web.StaticFileHandler):
    """The page and its modules, behind the same gate."""

    def initialize(self, gate: Gate, path: str, default_filename: Optional[str] = None) -> None:  # type: ignore
        """Called by Tornado."""
        self.gate = gate
        super().initialize(path, default_filename)

    def set_default_headers(self) -> None:
        """On every answer."""
        guard(self)

    def set_extra_headers(self, path: str) -> None:
        """After Tornado's own."""
        guard(self)

    def write_error(self, status_code: int, **_: Any) -> None:
        """The status alone."""
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish('{} {}\n'.format(status_code, self._reason))

    def prepare(self) -> None:
        """Before anything else."""
        status = self.gate.refusal(self, self.gate.files)
        if status:
            raise tornado.web.HTTPError(status)


class SessionHandler(Guarded):
    """GET: who am I; POST: a token for a session; DELETE: sign out."""

    def initialize(self, gate: Gate, close: Callable[[Session], None]) -> None:  # type: ignore[override]
        """Called by Tornado. `close`: the sockets of a session."""
        super().initialize(gate)
        self._close = close

    def get(self) -> None:
        """Say what the page needs to know before it opens the socket; begin a session where there is none."""
        session = self.gate.session(self)
        if session is None:
            session = self._begin(None)
        self._tell(session)

    def post(self) -> None:
        """Take a token."""
        session = self.demand_xsrf(self.gate.session(self))
        person = Person(self.request.remote_ip or '', session.short, '', '')
        if not self.gate.sign_ins.take(person.client):
            self.gate.audit.tell(person, 'sign_in', False, 'too many tries')
            raise tornado.web.HTTPError(429)
        tokens = self.gate.settings.tokens
        identity = tokens.identify(self._token()) if tokens is not None else None
        if identity is None:
            self.gate.audit.tell(person, 'sign_in', False, 'no such token')
            raise tornado.web.HTTPError(401)
        self._end(session)  # another page of this browser may have signed in meanwhile
        session = self._begin(identity)
        self.gate.audit.tell(Person(person.client, session.short, *identity), 'sign_in', True, '')
        self._tell(session)

    def delete(self) -> None:
        """Sign out: every page of this browser."""
        self._end(self.demand_xsrf(self.gate.session(self)))
        self._tell(self._begin(None))

    def _end(self, session: Session) -> None:
        if session.role:  # who has not signed in has nothing to end, and fills neither memory nor audit
            self.gate.end(session)
            self._close(session)
            self.gate.audit.tell(Person(self.request.remote_ip or '', session.short, session.role, session.name),
                                 'sign_out', True, '')

    def _begin(self, identity: Optional[Identity]) -> Session:
        session = sessions.new_session(identity)
        self.set_secure_cookie(self.gate.cookie, sessions.to_text(session), expires_days=None, httponly=True,
                               samesite='Strict', secure=self.gate.settings.scheme == 'https')
        return session

    def _tell(self, session: Session) -> None:
        identity = self.gate.identity(session)
        known: Dict[str, Any] = {'signed_in': identity is not None, 'role': identity.role if identity else '',
                                 'name': identity.name if identity else '',
                                 'tokens': self.gate.settings.tokens is not None,
                                 'xsrf': sessions.xsrf_token(session, self.gate.secret)}
        self.set_header('Content-Type', 'application/json')
        self.set_header('Cache-Control', 'no-store')
        self.finish(json.dumps(known))

    def _token(self) -> str:
        try:
            body = json.loads(self.request.body if len(self.request.body) <= LONGEST_BODY else b'')
        except ValueError as err:
            raise tornado.web.HTTPError(400) from err
        token = body.get('token') if isinstance(body, dict) else None
        if not isinstance(token, str):
            raise tornado.web.HTTPError(400)
        return token


class Limits(NamedTuple):
    """Of one socket."""

    commands: Bucket
    driving: Bucket  # commands of a page that has the wheel of a hand
    unruly: Bucket  # how often it may go beyond before it is closed


def guard(handler: tornado.web.RequestHandler) -> None:
    """Set the headers that keep a page to itself."""
    for name, value in HEADERS.items():
        handler.set_header(name, value)
    handler.clear_header('Server')
