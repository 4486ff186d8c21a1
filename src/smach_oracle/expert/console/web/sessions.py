"""Sessions of browsers: a signed cookie, and a token against forged requests. Pure."""

import hashlib
import hmac
import json
import math
import secrets
import time
from typing import NamedTuple, Optional

from .access import ROLES, Identity

HOURS = 12  # then a session ends


class BrowserSession(NamedTuple):
    """The content of the cookie."""

    id: str
    began_s: float  # since the epoch, as it outlives the server
    role: str = ''  # '' before signing in
    name: str = ''

    @property
    def short(self) -> str:
        """Return a name for it that gives nothing away."""
        return hashlib.sha256(self.id.encode()).hexdigest()[:8]

    @property
    def left_s(self) -> float:
        """Return the time (s) for which it is still valid. Below 0 where it has become too old."""
        return self.began_s + 3600.0 * HOURS - time.time()


def new_session(identity: Optional[Identity] = None) -> BrowserSession:
    """Return a session with an id of its own.

    Also at signing in, so that nobody is given somebody else's.
    """
    return BrowserSession(secrets.token_urlsafe(18), time.time(), *(identity or Identity('')))


def to_text(session: BrowserSession) -> str:
    """Return the text for the cookie, which others sign."""
    return json.dumps(list(session))


def from_text(text: Optional[bytes]) -> Optional[BrowserSession]:
    """Return the session that `to_text` has written, or None for any other text."""
    try:
        values = json.loads(text or b'null')
    except ValueError:
        return None
    if not isinstance(values, list) or [type(value) for value in values] != [str, float, str, str]:
        return None
    session = BrowserSession(*values)
    return session if math.isfinite(session.began_s) and session.role in ROLES + ('',) else None


def xsrf_token(session: BrowserSession, secret: str) -> str:
    """Return the token that a page of ours knows and a page elsewhere does not."""
    return hmac.new(secret.encode(), b'xsrf ' + session.id.encode(), hashlib.sha256).hexdigest()


def same(one: str, other: str) -> bool:
    """Compare in constant time."""
    return hmac.compare_digest(
        one.encode('utf-8', 'backslashreplace'), other.encode('utf-8', 'backslashreplace')
    )
