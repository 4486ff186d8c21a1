"""The node `expert_console`: a web page to watch robots and to answer their questions."""

import secrets
import socket
import ssl
import sys
import threading
import time
from functools import partial
from pathlib import Path
from typing import List, Mapping, Optional

import rospy
import tornado.ioloop
import tornado.netutil
import tornado.web

from smach_oracle.oracle.errors import SettingsError
from smach_oracle.ros.command_line import init_beside_others
from smach_oracle.ros.master_watch import start_master_watch

from ..front_end import FrontEnd
from ..repeating import repeat
from ..stop_calls import StopCalls
from .answering.interface_commands import InterfaceCommands
from .answering.last_heard import LastHeard
from .answering.precondition_sections import PreconditionStatuses
from .answering.question_commands import QuestionCommands
from .answering.question_sections import QuestionSections
from .answering.sensor_discovery import SensorDiscovery
from .answering.session_claims import SessionClaims
from .answering.teleoperation import Teleoperation
from .commands.commands import MOST_BYTES
from .feeds.node_pulse import NodePulse
from .graphs.layout_worker import LayoutWorker
from .options import make_parser
from .page_socket import OpenPages, PageSocket
from .people.people import People
from .people.shift_journal import ShiftJournal
from .reach.on_call import read_on_call
from .reach.reach import Reach
from .reach.try_calls import try_calls
from .robots.down_machine_hand import DownMachineHand
from .robots.down_machines import DownMachines
from .robots.followed_robots import FollowedRobots
from .robots.machine_hand import MachineHand
from .robots.robot_health import RobotHealth
from .sensors.images import NO_PICTURES, cv2
from .sensors.question_images import ImageStore, QuestionImages
from .sensors.question_replays import QuestionReplays
from .sensors.replay_handlers import ReplayFrameHandler, ReplayHandler, ReplayRequests
from .sensors.robot_clocks import ImageAges, RobotClocks
from .sensors.sample_handlers import RobotAppearanceHandler, SampleHandler, SensorRequests
from .sensors.sensor_streams import SensorStreams
from .trials.bag_catalogue import BagCatalogue
from .trials.history_handlers import HistoryRequests, QuestionImageHandler, RecordedHandler
from .trials.recorded_trials import RecordedTrials
from .trials.trial_log import TrialLog
from .web.access_control import AccessControl
from .web.audit import Audit
from .web.connections import LimitedServer
from .web.handlers import NotFoundHandler, PageFileHandler, SessionHandler
from .web.sections import PageSections
from .web.settings import NONE, ConsoleSettings, read_settings

STATIC = Path(__file__).resolve().parent / 'static'
PUSH_PERIOD_MS = 100
ROBOTS_PERIOD_S = 1.5
SECTIONS_PERIOD_S = 0.1
OVERVIEW_PERIOD_S = 0.5
REACH_PERIOD_S = 0.5
PING_S = 5.0
PONG_LIMIT_S = 15.0


def make_app(
    access: AccessControl,
    pages: OpenPages,
    sensors: SensorStreams,
    history: HistoryRequests,
    ages: Optional[ImageAges] = None,
    replays: Optional[QuestionReplays] = None,
) -> tornado.web.Application:
    """Return the web application. Its handlers run in the thread of the loop that serves it."""
    shared = SensorRequests(sensors, ages)
    replayed = ReplayRequests((replays or QuestionReplays()).find, history.recorded.find_replay)
    static = {'path': str(STATIC)}
    return tornado.web.Application(
        [
            (r'/session', SessionHandler, {'close': pages.close}),
            (r'/socket', PageSocket, {'pages': pages}),
            (r'/sample/([0-9]{1,9})', SampleHandler, {'shared': shared}),
            (r'/model/([0-9]{1,9})', RobotAppearanceHandler, {'shared': shared}),
            (r'/recorded/([0-9]{1,9})', RecordedHandler, {'shared': history}),
            (r'/image/([0-9]{1,9})', QuestionImageHandler, {'shared': history}),
            (r'/replay/([0-9]{1,9})', ReplayHandler, {'shared': replayed}),
            (r'/replay/([0-9]{1,9})/([0-9]{1,5})', ReplayFrameHandler, {'shared': replayed}),
            (r'/()', PageFileHandler, dict(static, default_filename='index.html')),
            (r'/static/(.+)', PageFileHandler, static),
        ],
        access=access,
        default_handler_class=NotFoundHandler,
        cookie_secret=access.secret,
        websocket_ping_interval=PING_S,
        websocket_ping_timeout=PONG_LIMIT_S,
        websocket_max_message_size=MOST_BYTES,
        log_function=_log_request,
    )


def _log_request(handler: tornado.web.RequestHandler) -> None:
    status = handler.get_status()
    log = rospy.logdebug if status < 400 else rospy.logwarn
    log(
        '%d %s %r from %s',
        status,
        handler.request.method,
        handler.request.path[:100],
        handler.request.remote_ip,
    )


class Console:
    """Everything behind the page."""

    def __init__(self, settings: ConsoleSettings) -> None:
        """Listen on the address of the settings.

        :raises SettingsError: where the address cannot be listened on, or the certificate not be
            used.
        """
        tls = tls_context(settings)
        sockets = _listen(settings)
        port = sockets[0].getsockname()[1]
        self.url = '{}://{}:{}/'.format(settings.scheme, _shown(settings.address), port)
        self._sections = PageSections()
        self._log = TrialLog()
        self._audit = Audit()
        layouts = LayoutWorker()
        self._clocks = RobotClocks()
        stop_calls = StopCalls()
        self._people = People(ShiftJournal(settings.shift_file), settings.shifts, self._audit)
        self._robots = FollowedRobots(
            self._sections,
            self._log,
            layouts,
            self._clocks,
            stop_calls.look_up,
            self._people.take_event,
        )
        self._health = RobotHealth()
        self._down = DownMachines(settings.stores, self._sections)
        self._front_end = FrontEnd('expert_console')
        self._discovery = SensorDiscovery(self._sections, self._front_end, settings.cameras)
        self._preconditions = PreconditionStatuses()
        files = ImageStore()
        self._question_images = QuestionImages(
            files, self._discovery.sensors, self._discovery.cameras
        )
        self._replays = QuestionReplays()
        self._catalogue = BagCatalogue(settings.bags, self._sections)
        self._teleoperation = Teleoperation(self._sections, self._front_end, self._audit)
        master = start_master_watch()
        self._last_heard = LastHeard(
            self._front_end, NodePulse(), self._robots.nodes, lambda: master.heard_s, self._clocks
        )
        questions = QuestionCommands(
            self._front_end,
            self._audit,
            InterfaceCommands(self._teleoperation.is_interface).commands,
            self._last_heard.refusal,
            settings.idle_s,
        )
        self._question_sections = QuestionSections(self._front_end, self._log, questions.sessions)
        self._machine_hand = MachineHand(
            self._robots.holdable, self._audit, self._last_heard.robot_refusal, stop_calls
        )
        self._pages = OpenPages(
            self._sections,
            self._log,
            questions,
            self._teleoperation,
            self._machine_hand,
            DownMachineHand(self._down, self._audit),
            self._people,
        )
        secret = settings.tokens.cookie_secret if settings.tokens else secrets.token_hex(32)
        access = AccessControl(settings._replace(port=port), secret, self._audit)
        app = make_app(
            access,
            self._pages,
            self._discovery.sensors,
            HistoryRequests(RecordedTrials(self._catalogue, layouts, files), files),
            ImageAges(self._clocks, self._discovery.cameras),
            self._replays,
        )
        server = LimitedServer(
            app,
            ssl_options=tls,
            max_body_size=MOST_BYTES,
            max_header_size=16384,
            body_timeout=10.0,
            idle_connection_timeout=60.0,
            max_buffer_size=4 * MOST_BYTES,
        )
        server.connections = access.connections
        server.proxies = settings.proxies
        server.add_sockets(sockets)
        self._reach = self._begin_reach(settings, questions.sessions)
        self._overview_s = -OVERVIEW_PERIOD_S

    def _begin_reach(self, settings: ConsoleSettings, claims: SessionClaims) -> Optional[Reach]:
        if not settings.on_call or settings.public is None:
            return None
        return Reach(
            read_on_call(settings.on_call),
            settings.public.origin,
            self._sections,
            self._front_end.questions,
            claims.waits,
            self._question_images.picture_of,
        )

    def run(self) -> None:
        """Serve until the node goes down."""
        self._discovery.start()
        self._teleoperation.start()
        repeat(self._robots.discover, ROBOTS_PERIOD_S)
        repeat(self._down.look, ROBOTS_PERIOD_S)
        repeat(self._health.discover, ROBOTS_PERIOD_S)
        repeat(self._people.acts.follow, ROBOTS_PERIOD_S)
        repeat(self._people.keep, ROBOTS_PERIOD_S)
        repeat(self._write_sections, SECTIONS_PERIOD_S)
        if self._reach is not None:
            repeat(self._reach.look, REACH_PERIOD_S)
        threading.Thread(target=self._catalogue.run, name='bags', daemon=True).start()
        loop = tornado.ioloop.IOLoop.current()
        rospy.on_shutdown(lambda: loop.add_callback(loop.stop))
        tornado.ioloop.PeriodicCallback(self._pages.push, PUSH_PERIOD_MS).start()
        loop.start()

    def _write_sections(self) -> None:
        """Make sections of what ROS threads have taken in."""
        self._last_heard.write_sections(self._sections)
        self._robots.write_sections()
        self._question_sections.write_sections(self._sections)
        questions = self._front_end.questions()
        self._preconditions.write_sections(self._sections, questions)
        self._question_images.write_sections(self._sections, questions)
        self._replays.write_sections(self._sections, questions)
        if time.monotonic() - self._overview_s > OVERVIEW_PERIOD_S:
            self._overview_s = time.monotonic()
            self._audit.prepare(self._front_end.servers)
            self._pages.write_trials()
            self._people.write_sections(self._sections)
            robots = {*self._robots.nodes(), *(each.goal.robot for each in questions)}
            self._discovery.cameras.write_sections(self._sections, robots)
            self._health.write_sections(self._sections, robots)


def _listen(settings: ConsoleSettings) -> List[socket.socket]:
    try:
        return tornado.netutil.bind_sockets(settings.port, settings.address)
    except OSError as err:
        raise SettingsError(
            '~address, ~port',
            '{}, {}'.format(settings.address, settings.port),
            'an address of this machine and a port that is free ({})'.format(err),
        ) from err


def tls_context(settings: ConsoleSettings) -> Optional[ssl.SSLContext]:
    """Return the context for https, or None where no certificate is set.

    :raises SettingsError: naming the file that cannot be read, or why the two do not belong
        together.
    """
    if not settings.certificate:
        return None
    files = (('~certificate', settings.certificate), ('~private_key', settings.private_key))
    for name, path in files:
        try:
            with open(path, 'rb'):
                pass
        except OSError as err:
            raise SettingsError(
                name, path, 'a PEM file that can be read ({})'.format(err.strerror)
            ) from err
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(settings.certificate, settings.private_key, _ask_nobody)
    except ssl.SSLError as err:
        raise SettingsError(
            '~certificate, ~private_key',
            ', '.join(path for _, path in files),
            'a certificate and the key that it was made with, both PEM ({})'.format(
                err.reason or err
            ),
        ) from err
    return context


def _ask_nobody() -> str:
    raise SettingsError(
        '~private_key',
        'a key with a passphrase',
        'one without, in a file that its owner alone may read',
    )


def _shown(address: str) -> str:
    return '[{}]'.format(address) if ':' in address else address


def parameter(options: Mapping[str, object], name: str, default: object) -> object:
    """Return the value of an option, else of the parameter of its name, else the default."""
    given = options.get(name)
    value: object = rospy.get_param('~' + name, default) if given is None else given
    return value


def _try_calls(settings: ConsoleSettings) -> int:
    """Print who was reached, and return the exit status: 1 where anybody was not."""
    if not settings.on_call or settings.public is None:
        raise SettingsError('~on_call', NONE, 'a file that says who is called (doc/on_call.md)')
    tried = try_calls(read_on_call(settings.on_call), settings.public.origin)
    sys.stdout.writelines(each.words + '\n' for each in tried)
    return int(any(each.why for each in tried))


def main() -> None:
    """Entry point of the node `expert_console`."""
    options = vars(make_parser().parse_args(rospy.myargv()[1:]))
    init_beside_others('expert_console')
    start_master_watch()
    tornado.ioloop.IOLoop.current()
    try:
        settings = read_settings(partial(parameter, options))
        if options['try_calls']:
            raise SystemExit(_try_calls(settings))
        console = Console(settings)
    except SettingsError as err:
        rospy.logfatal('%s', err)
        raise SystemExit(2) from err
    if cv2 is None:
        rospy.logwarn('%s', NO_PICTURES)
    rospy.loginfo('The operator console is at %s', console.url)
    console.run()
