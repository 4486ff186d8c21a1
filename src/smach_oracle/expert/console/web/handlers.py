"""HTTP handlers of the page and the session. Every request passes the same access control first."""

import json
from typing import Callable, Optional, Protocol

import tornado.web

from smach_oracle.oracle.records.short_text import shortened

from ..shapes.page import SessionView
from . import sessions
from .access import ClientRateLimits, Identity, network_of
from .access_control import AccessControl
from .audit import Person
from .sessions import BrowserSession

POLICY = '; '.join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob:",
        "connect-src 'self'",
        "manifest-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
        "trusted-types 'none'",
    ]
)
HEADERS = {
    'Content-Security-Policy': POLICY,
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cache-Control': 'no-cache',
    'Permissions-Policy': 'camera=(), microphone=(), geolocation=()',
}
LONGEST_BODY = 4096


def access_of(handler: tornado.web.RequestHandler) -> AccessControl:
    """Return what all handlers of an application share: its setting `access`."""
    access: AccessControl = handler.settings['access']
    return access


class CheckedHandler(tornado.web.RequestHandler):
    """A handler behind the access control."""

    @property
    def access(self) -> AccessControl:
        """Return what all handlers share."""
        return access_of(self)

    def set_default_headers(self) -> None:
        """Set the headers of every answer, errors among them."""
        set_security_headers(self)

    def prepare(self) -> None:
        """Before anything else."""
        self.demand_admission()

    def demand_admission(
        self, limits: Optional[ClientRateLimits] = None, limited: bool = True
    ) -> None:
        """Let a request pass the access control, or answer it with the status of the refusal."""
        status = self.access.refusal(self, limits, limited)
        if status:
            raise tornado.web.HTTPError(status)

    def check_xsrf_cookie(self) -> None:
        """Our own check is in `demand_xsrf`."""

    def demand_xsrf(self, session: Optional[BrowserSession]) -> BrowserSession:
        """Return the session, of a request that knows its token. Any other is answered with 403."""
        given = self.request.headers.get('X-Xsrf', '')
        if session is None or not sessions.same(
            given, sessions.xsrf_token(session, self.access.secret)
        ):
            raise tornado.web.HTTPError(403)
        return session

    def write_error(self, status_code: int, **_: object) -> None:
        """The status alone: nothing of the request comes back."""
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish('{} {}\n'.format(status_code, self._reason))


class SharedByRequests(Protocol):
    """The objects that the requests of one kind share."""

    limits: ClientRateLimits


class SignedInHandler(CheckedHandler):
    """A handler for our own pages, of people who are signed in. It has limits of its own."""

    def initialize(self, shared: SharedByRequests) -> None:
        """Called by Tornado."""
        self._shared = shared

    def prepare(self) -> None:
        """Check access, who it is, and that a page of ours asks."""
        self.demand_admission(self._shared.limits)
        session = self.access.session(self)
        if self.access.identity(session) is None:
            raise tornado.web.HTTPError(401)
        self.demand_xsrf(session)
        self.set_header('Cache-Control', 'no-store')

    def refuse(self, err: Exception) -> None:
        """Answer 422 with a text: the thing asked for cannot be shown."""
        self.set_status(422)
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish(shortened(str(err), 500))


class PathOnlyHandler(SignedInHandler):
    """Has no arguments but those in its path."""

    def prepare(self) -> None:
        """Check access and who it is. Refuse arguments."""
        super().prepare()
        if self.request.query_arguments:
            raise tornado.web.HTTPError(400)


class NotFoundHandler(CheckedHandler):
    """Everything else."""

    def prepare(self) -> None:
        """Answer 404, after the access control."""
        super().prepare()
        raise tornado.web.HTTPError(404)


class PageFileHandler(CheckedHandler, tornado.web.StaticFileHandler):
    """The page and its modules."""

    def set_extra_headers(self, path: str) -> None:
        """After Tornado's own."""
        set_security_headers(self)

    def prepare(self) -> None:
        """Before anything else."""
        self.demand_admission(self.access.files)


class SessionHandler(CheckedHandler):
    """GET: who am I; POST: a token for a session; DELETE: sign out."""

    def initialize(self, close: Callable[[BrowserSession], None]) -> None:
        """Called by Tornado. `close`: the sockets of a session."""
        self._close = close

    def prepare(self) -> None:
        """Check access. Who comes with a right token is never too fast, whatever others try.

        Wrong ones have limits of their own, and so take nothing from those who load the page.
        """
        if self.request.method == 'POST':
            self.demand_admission(self.access.wrong_tokens, limited=not self._is_right())
        else:
            super().prepare()

    def get(self) -> None:
        """Answer with what the page needs before it opens the socket.

        Begin a session where there is none.
        """
        session = self.access.session(self)
        if session is None:
            session = self._begin(None)
        self._answer(session)

    def post(self) -> None:
        """Take a token."""
        session = self.demand_xsrf(self.access.session(self))
        person = Person(self.request.remote_ip or '', session.short, '', '')
        identity = self._given()
        if identity is None:
            slow = not self.access.sign_ins.take(network_of(person.client))
            self.access.audit.record(
                person, 'sign_in', False, 'too many tries' if slow else 'no such token'
            )
            raise tornado.web.HTTPError(429 if slow else 401)
        self._end(session)  # another page of this browser may have signed in meanwhile
        session = self._begin(identity)
        self.access.audit.record(
            Person(person.client, session.short, *identity), 'sign_in', True, ''
        )
        self._answer(session)

    def delete(self) -> None:
        """Sign out: every page of this browser."""
        self._end(self.demand_xsrf(self.access.session(self)))
        self._answer(self._begin(None))

    def _end(self, session: BrowserSession) -> None:
        # a session that is not signed in must fill neither memory nor audit
        if session.role:
            self.access.end(session)
            self._close(session)
            self.access.audit.record(
                Person(self.request.remote_ip or '', session.short, session.role, session.name),
                'sign_out',
                True,
                '',
            )

    def _begin(self, identity: Optional[Identity]) -> BrowserSession:
        session = sessions.new_session(identity)
        self.set_secure_cookie(
            self.access.cookie,
            sessions.to_text(session),
            expires_days=None,
            httponly=True,
            samesite='Strict',
            secure=self.request.protocol == 'https',
        )
        return session

    def _answer(self, session: BrowserSession) -> None:
        identity = self.access.identity(session)
        known: SessionView = {
            'signed_in': identity is not None,
            'role': identity.role if identity else '',
            'name': identity.name if identity else '',
            'tokens': self.access.settings.tokens is not None,
            'xsrf': sessions.xsrf_token(session, self.access.secret),
        }
        self.set_header('Content-Type', 'application/json')
        self.set_header('Cache-Control', 'no-store')
        self.finish(json.dumps(known))

    def _given(self) -> Optional[Identity]:
        """Return whose token comes with the request, or None for a wrong one."""
        tokens = self.access.settings.tokens
        return tokens.identify(self._token()) if tokens is not None else None

    def _is_right(self) -> bool:
        try:
            return self._given() is not None
        except tornado.web.HTTPError:  # it is no token at all: `post` answers
            return False

    def _token(self) -> str:
        try:
            body = json.loads(self.request.body if len(self.request.body) <= LONGEST_BODY else b'')
        except (ValueError, RecursionError) as err:
            raise tornado.web.HTTPError(400) from err
        token = body.get('token') if isinstance(body, dict) else None
        if not isinstance(token, str):
            raise tornado.web.HTTPError(400)
        return token


def set_security_headers(handler: tornado.web.RequestHandler) -> None:
    """Set the headers that keep a page to itself."""
    for name, value in HEADERS.items():
        handler.set_header(name, value)
    handler.clear_header('Server')
