"""The checks that every request passes first: its host, its rate, its origin, and its session."""

import time
from typing import Any, Dict, Optional, Tuple

import rospy
import tornado.httputil
import tornado.web

from . import sessions
from .access import ClientRateLimits, Identity, RateLimit, network_of
from .audit import Audit
from .connections import OpenConnections
from .sessions import BrowserSession
from .settings import ConsoleSettings


class AccessControl:
    """The objects that all handlers share: settings, limits, and the keys of the cookie."""

    def __init__(self, settings: ConsoleSettings, secret: str, audit: Audit) -> None:
        self.settings = settings
        self.secret = secret
        self.audit = audit
        self.connections = OpenConnections(proxies=settings.proxies)
        self._warnings = RateLimit(1.0 / 60.0, 1.0)
        self.cookie = 'console_{}'.format(settings.port)
        self.requests = ClientRateLimits(rate=30.0, burst=150.0, for_all=5.0)
        # a page has some 100. A browser may open many pages
        self.files = ClientRateLimits(rate=100.0, burst=2600.0, for_all=5.0)
        # wrong tokens: those that are answered as such, and those that are heard at all
        self.sign_ins = ClientRateLimits(rate=0.2, burst=5.0, for_all=4.0)
        self.wrong_tokens = ClientRateLimits(rate=2.0, burst=20.0, for_all=5.0)
        # id of a session -> when, s, of those whose cookie might still be good
        self._ended: Dict[str, float] = {}

    def session(self, handler: tornado.web.RequestHandler) -> Optional[BrowserSession]:
        """Return the session of a request's cookie, or None where it has none of ours."""
        session = sessions.from_text(
            handler.get_secure_cookie(self.cookie, max_age_days=sessions.HOURS / 24.0)
        )
        over = session is None or session.id in self._ended or session.left_s <= 0.0
        return None if over else session

    def end(self, session: BrowserSession) -> None:
        """End a session: its cookie, of which somebody may have a copy, is refused from now on."""
        now_s = time.monotonic()
        self._ended = {
            id_: at_s for id_, at_s in self._ended.items() if now_s - at_s < 3600.0 * sessions.HOURS
        }
        self._ended[session.id] = now_s

    def identity(self, session: Optional[BrowserSession]) -> Optional[Identity]:
        """The role and name of a session, or None where it is not signed in any more, or too old.

        Without tokens everybody who gets here may do everything, for as long as the page is open.
        """
        if session is not None and session.id in self._ended:
            return None
        if self.settings.tokens is None:
            return Identity('teleoperator') if session else None
        signed_in = session is not None and session.role and session.left_s > 0.0
        return Identity(session.role, session.name) if session and signed_in else None

    def refusal(
        self,
        handler: tornado.web.RequestHandler,
        limits: Optional[ClientRateLimits] = None,
        limited: bool = True,
    ) -> int:
        """Return the status with which a request is refused, or 0 where it may go on.

        :param limits: of its own, where it has any.
        :param limited: False: it is never too fast.
        """
        request = handler.request
        if not self._is_for_us(request):
            return 421
        session = self.session(handler)
        known = session.id if session is not None and self.identity(session) else ''
        if not self.connections.heard(request, known):
            return 503
        if limited and not (limits or self.requests).take(*self._share_of(request, known)):
            return 429
        if not self.from_own_page(handler, must_say=request.method not in ('GET', 'HEAD')):
            return 403
        return 0

    def _is_for_us(self, request: tornado.httputil.HTTPServerRequest) -> bool:
        """Whether it calls this console by a name of its own: through a proxy by one alone."""
        host = request.headers.get('Host', '')
        public = self.settings.public
        if public is None or not self._is_passed_on(request):
            return self.settings.hosts.allows(host)
        if public.is_host(host) and request.protocol == public.scheme:
            return True
        if self._warnings.take():
            rospy.logwarn(
                'A proxy passes on requests with Host %r and X-Forwarded-Proto %r. They are '
                'refused, since ~public_address is %s.',
                host[:100],
                request.protocol[:10],
                public.origin,
            )
        return False

    def _is_passed_on(self, request: tornado.httputil.HTTPServerRequest) -> bool:
        """Whether a proxy that is trusted has passed a request on."""
        context: Any = getattr(request.connection, 'context', None)
        return context is not None and self.settings.proxies.trusts(str(context.remote_ip))

    def _share_of(
        self, request: tornado.httputil.HTTPServerRequest, known: str
    ) -> Tuple[str, bool]:
        """Return who a request counts for in the limits, and whether it has come with a token.

        Strangers of the same address, or very many of them, take nothing from who has a token.
        """
        if self.settings.tokens is not None and known:
            return 'session ' + known, True
        return network_of(request.remote_ip or ''), False

    def from_own_page(self, handler: tornado.web.RequestHandler, must_say: bool) -> bool:
        """Whether the Origin is this console. `must_say`: a request without one is refused, too."""
        headers = handler.request.headers
        origin = headers.get('Origin')
        if origin is None:
            return not must_say
        public = self.settings.public
        if public is not None and self._is_passed_on(handler.request):
            return origin.lower() == public.origin
        return self.settings.hosts.allows_origin(
            origin, headers.get('Host', ''), self.settings.scheme
        )
