"""The node `expert_console`: a web page from which people watch robots and answer their questions (paper, III)."""
import secrets
import socket
import ssl
import threading
import time
from pathlib import Path
from typing import Any, List, Optional

import rospy
import tornado.httpserver
import tornado.ioloop
import tornado.netutil
import tornado.web

from ...oracle.errors import ConfigError
from ...ros.command_line import parameters_only
from ...ros.master_watch import start_master_watch
from ..front_end import FrontEnd
from .audit import Audit
from .bags import BagShelf
from .commands import MOST_BYTES
from .conditions import Conditions
from .desk import Desk
from .eye import Eye
from .frames import FrameHandler, FrameRoom, ModelHandler
from .hands import Hands
from .handlers import Gate, NotThere, SessionHandler, StaticFile
from .history_handlers import HistoryRoom, RecordedHandler, StillHandler
from .layout import Layouter
from .questions import QuestionBoard
from .recorded import RecordedTrials
from .robots import Robots
from .sections import Sections
from .sensors import Sensors
from .settings import ConsoleSettings, read_settings
from .stills import StillFiles, Stills
from .page_socket import Office, Socket
from .perception_desk import PerceptionDesk
from .trial_log import TrialLog

STATIC = Path(__file__).resolve().parent / 'static'
PUSH_PERIOD_MS = 100
DRAW_PERIOD_S = 0.1
OVERVIEW_PERIOD_S = 0.5
PING_S = 5.0
PONG_LIMIT_S = 15.0


def make_app(gate: Gate, office: Office, sensors: Sensors, history: HistoryRoom) -> tornado.web.Application:
    """The web application; its handlers run in the thread of the loop that serves it."""
    shared = {'gate': gate}
    room = FrameRoom(sensors)
    return tornado.web.Application(
        [(r'/session', SessionHandler, {'gate': gate, 'close': office.close}),
         (r'/socket', Socket, {'gate': gate, 'office': office}),
         (r'/frame/([0-9]{1,9})', FrameHandler, {'gate': gate, 'room': room}),
         (r'/model/([0-9]{1,9})', ModelHandler, {'gate': gate, 'room': room}),
         (r'/recorded/([0-9]{1,9})', RecordedHandler, {'gate': gate, 'room': history}),
         (r'/still/([0-9]{1,9})', StillHandler, {'gate': gate, 'room': history}),
         (r'/()', StaticFile, dict(shared, path=str(STATIC), default_filename='index.html')),
         (r'/static/(.+)', StaticFile, dict(shared, path=str(STATIC)))],
        default_handler_class=NotThere, default_handler_args=shared, cookie_secret=gate.secret,
        websocket_ping_interval=PING_S, websocket_ping_timeout=PONG_LIMIT_S, websocket_max_message_size=MOST_BYTES,
        log_function=_log_request)


def _log_request(handler: tornado.web.RequestHandler) -> None:
    status = handler.get_status()
    log = rospy.logdebug if status < 400 else rospy.logwarn
    log('%d %s %r from %s', status, handler.request.method, handler.request.path[:100], handler.request.remote_ip)


class Console:
    """Everything behind the page."""

    def __init__(self, settings: ConsoleSettings) -> None:
        """:raises ConfigError: where the address cannot be listened on, or the certificate not be used."""
        tls = tls_context(settings)
        sockets = _listen(settings)
        port = sockets[0].getsockname()[1]
        self.url = '{}://{}:{}/'.format(settings.scheme, _shown(settings.address), port)
        self._sections = Sections()
        self._log = TrialLog()
        self._audit = Audit()
        layouter = Layouter()
        self._robots = Robots(self._sections, self._log, layouter)
        self._front_end = FrontEnd('expert_console')
        self._eye = Eye(self._sections, self._front_end)
        self._board = QuestionBoard(self._front_end, self._log)
        self._conditions = Conditions()
        files = StillFiles()
        self._stills = Stills(files, self._eye.sensors)
        self._shelf = BagShelf(settings.bags, self._sections)
        self._hands = Hands(self._sections, self._front_end, self._audit)
        self._office = Office(self._sections, self._log, Desk(
            self._front_end, self._audit, PerceptionDesk(self._hands.is_interface).commands), self._hands)
        secret = settings.tokens.cookie_secret if settings.tokens else secrets.token_hex(32)
        app = make_app(Gate(settings._replace(port=port), secret, self._audit), self._office, self._eye.sensors,
                       HistoryRoom(RecordedTrials(self._shelf, layouter, files), files))
        server = tornado.httpserver.HTTPServer(
            app, ssl_options=tls, max_body_size=MOST_BYTES, max_header_size=16384, body_timeout=10.0,
            idle_connection_timeout=60.0, max_buffer_size=4 * MOST_BYTES)
        server.add_sockets(sockets)

    def run(self) -> None:
        """Serve until the node goes down."""
        self._eye.start()
        self._hands.start()
        for target in (self._robots.run, self._draw, self._shelf.run):
            threading.Thread(target=target, name=target.__name__, daemon=True).start()
        loop = tornado.ioloop.IOLoop.current()
        rospy.on_shutdown(lambda: loop.add_callback(loop.stop))
        tornado.ioloop.PeriodicCallback(self._office.push, PUSH_PERIOD_MS).start()
        loop.start()

    def _draw(self) -> None:
        """What ROS threads have taken in becomes sections, at most ten times a second."""
        overview_s = 0.0
        while not rospy.is_shutdown():
            try:
                self._robots.draw()
                self._board.draw(self._sections)
                questions = self._front_end.questions()
                self._conditions.draw(self._sections, questions)
                self._stills.draw(self._sections, questions)
                if time.monotonic() - overview_s > OVERVIEW_PERIOD_S:
                    overview_s = time.monotonic()
                    self._audit.prepare(self._front_end.servers)
                    self._sections.put('trials', self._log.overview())
            except Exception as err:  # what one robot sends must not take the others' pages away
                rospy.logerr_throttle(10, 'The page could not be brought up to date: {!r}'.format(err))
            time.sleep(DRAW_PERIOD_S)


def _listen(settings: ConsoleSettings) -> List[socket.socket]:
    try:
        return tornado.netutil.bind_sockets(settings.port, settings.address)
    except OSError as err:
        raise ConfigError('~address, ~port', '{}, {}'.format(settings.address, settings.port),
                          'an address of this machine and a port that is free ({})'.format(err)) from err


def tls_context(settings: ConsoleSettings) -> Optional[ssl.SSLContext]:
    """What https needs; None where no certificate is set.

    :raises ConfigError: naming the file that cannot be read, or why the two do not belong together.
    """
    if not settings.certificate:
        return None
    files = (('~certificate', settings.certificate), ('~private_key', settings.private_key))
    for name, path in files:
        try:
            with open(path, 'rb'):
                pass
        except OSError as err:
            raise ConfigError(name, path, 'a PEM file that can be read ({})'.format(err.strerror)) from err
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(*(path for _, path in files), password=_ask_nobody)
    except ssl.SSLError as err:
        raise ConfigError('~certificate, ~private_key', ', '.join(path for _, path in files),
                          'a certificate and the key that it was made with, both PEM ({})'.format(
                              err.reason or err)) from err
    return context


def _ask_nobody() -> str:
    raise ConfigError('~private_key', 'a key with a passphrase', 'one without, in a file that its owner alone may read')


def _shown(address: str) -> str:
    return '[{}]'.format(address) if ':' in address else address


def _parameter(name: str, default: Any) -> Any:
    return rospy.get_param('~' + name, default)


def main() -> None:
    """Entry point of the node `expert_console`."""
    parameters_only('Node: a web page from which people watch robots and answer their questions. Parameters: ~address, '
                    '~port, ~allow_remote, ~token_file, ~hosts, ~certificate, ~private_key, ~bags; see doc/console.md.')
    rospy.init_node('expert_console')
    start_master_watch()
    tornado.ioloop.IOLoop.current()
    try:
        console = Console(read_settings(_parameter))
    except ConfigError as err:
        rospy.logfatal('%s', err)
        raise SystemExit(2) from err
    rospy.loginfo('The operator console is at %s', console.url)
    console.run()
