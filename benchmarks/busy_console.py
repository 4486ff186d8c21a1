#!/usr/bin/env python3
"""The time until a page has the mask of a drawing, and until a hand stands, next to busy cores.

    benchmarks/busy_console.py [--busy N] [--nice N] [--marks N] [--stops N] [--check]

The console, a perception and a manipulation interface are nodes of their own, on a master of their
own. A camera streams, and a page shows it. The load are N processes that never rest (default: one
for each core); --busy 0 measures without. A mark counts from the page's message until the console's
reply has come. A hand counts from the page's message (let go, or the stop button) until its last
joint target has been reached. --check fails where one of ten marks takes more than 300 ms, or one
of ten stops more than 100 ms.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np

LIMITS_S = {'mark': 0.3, 'of it in the interface': 0.3, 'let go': 0.1, 'stop button': 0.1}
SHARE = 90  # percent that must be in time
REST_S = 0.4  # without a motion: it stands
CAN_INDEX = 1
ANY_IMAGE = '0.000000000'  # the stamp that stands for the image in use
CAMERA = '/head_camera/rgb/image_raw'
HERE = os.path.dirname(os.path.abspath(__file__))
FIXTURES = os.path.join(HERE, '..', 'test', 'rostest')
LAUNCH = """<launch>{nice}
  <node pkg="smach_oracle" type="perception_interface" name="perception_interface">
    <rosparam command="load" file="$(find smach_oracle)/launch/perception_interface.yaml"/>
  </node>
  <node pkg="smach_oracle" type="manipulation_interface" name="manipulation_interface">
    <rosparam command="load" file="{fixtures}/teleoperation.yaml"/>
  </node>
  <node pkg="smach_oracle" type="expert_console" name="expert_console" args="_port:={port}"/>
</launch>"""

sys.path.insert(0, FIXTURES)


class Page:
    """A page without a browser: one socket, its commands, and an image that is shown."""

    def __init__(self, port):
        self._address = 'localhost:{}'.format(port)
        self._socket = None
        self._headers = {}
        self._replies, self._sections = {}, {}
        self._number = 0

    async def open(self):
        """Sign in, as a browser does."""
        from tornado.httpclient import AsyncHTTPClient, HTTPRequest
        from tornado.websocket import websocket_connect

        answer = await AsyncHTTPClient().fetch('http://{}/session'.format(self._address))
        cookie = answer.headers['Set-Cookie'].split(';')[0]
        self._socket = await websocket_connect(
            HTTPRequest(
                'ws://{}/socket'.format(self._address),
                headers={'Origin': 'http://' + self._address, 'Cookie': cookie},
            ),
            max_message_size=1 << 26,
        )
        reader = asyncio.get_running_loop().create_task(self._read())
        reader.add_done_callback(lambda _: None)
        self._headers = {'Cookie': cookie, 'X-Xsrf': json.loads(answer.body)['xsrf']}
        await self.ask('hello', xsrf=self._headers['X-Xsrf'], expert='ann')
        return self

    async def _read(self):
        while True:
            text = await self._socket.read_message()
            if text is None:
                return
            message = json.loads(text)
            if 're' in message:
                self._replies.pop(message['re']).set_result(message)
            self._sections.update(message.get('sections', {}))

    async def ask(self, command, **arguments):
        """Send a command; its reply, which must be good."""
        reply = self.send(command, **arguments)
        answer = await asyncio.wait_for(reply, 40.0)
        if not answer['ok']:
            raise RuntimeError('{}: {}'.format(command, answer['message']))
        return answer

    def send(self, command, **arguments):
        """Send a command; what its reply comes to."""
        self._number += 1
        self._replies[self._number] = reply = asyncio.get_running_loop().create_future()
        self._socket.write_message(json.dumps(dict(arguments, id=self._number, do=command)))
        return reply

    async def section(self, name, wanted=bool):
        """A section, once it is as it is wanted."""
        until_s = time.monotonic() + 60.0
        while not wanted(self._sections.get(name)):
            if time.monotonic() > until_s:
                raise RuntimeError('{} is {}'.format(name, self._sections.get(name)))
            await asyncio.sleep(0.02)
        return self._sections[name]

    async def start_interface(self, robot, name):
        """Answer the question of a robot by an interface; the question's key."""

        def asked(questions):
            return any(each['robot'] == robot for each in questions or ())

        key = next(
            each['key'] for each in await self.section('questions', asked) if each['robot'] == robot
        )
        await self.ask('claim', question=key)
        await self.ask('answer', question=key, kind='interface', name=name, outputs=[], why='')
        return key

    async def look_on(self):
        """Show the camera, as a page does: the next frame once the last is there."""
        from tornado.httpclient import AsyncHTTPClient, HTTPClientError

        sensors = (
            await self.section(
                'sensors', lambda it: it and any(each['topic'] == CAMERA for each in it['sensors'])
            )
        )['sensors']
        number = next(each['id'] for each in sensors if each['topic'] == CAMERA)
        newest = 0
        while True:
            with contextlib.suppress(HTTPClientError):
                answer = await AsyncHTTPClient().fetch(
                    'http://{}/sample/{}?after={}&width=640'.format(self._address, number, newest),
                    headers=self._headers,
                )
                newest = int(answer.headers.get('X-Sequence', newest))
            await asyncio.sleep(0.05)


async def measured_marks(page, marks, region):
    """s that each takes, and s of it in the interface."""
    key = await page.start_interface('/marker', 'perception')
    await page.section(
        'sensors', lambda it: it and key in it['perception'] and it['perception'][key]['image']
    )
    region = {'question': key, 'stamp': ANY_IMAGE, 'region': region, 'strokes': []}
    until_s = time.monotonic() + 60.0
    while not (await page.send('mark', **region))['ok'] and time.monotonic() < until_s:
        await asyncio.sleep(0.2)  # the interface begins, and takes its image
    taken, inside = [], []
    while len(taken) < marks + 2:
        begun_s = time.monotonic()
        reply = await page.ask('mark', **region)
        taken.append(time.monotonic() - begun_s)
        inside.append(reply['data']['elapsed'])
        await asyncio.sleep(0.1)  # a person draws
    # the first ones still make connections
    return {'mark': taken[2:], 'of it in the interface': inside[2:]}


async def measured_stops(page, arm, stops):
    """s that each takes: by letting go, and by the button."""
    key = await page.start_interface('/driver', 'manipulation')
    await page.section('manipulation', lambda it: key in (it or {}) and 'state' in it[key])
    taken = {'let go': [], 'stop button': []}
    up = 1
    while len(taken['stop button']) < stops:
        for how, times in taken.items():
            await page.ask('take_wheel', question=key)
            up = -up
            await drive(page, key, arm, up)
            begun_s = time.monotonic()
            if how == 'let go':
                page.send('drive', **wish(key, False, 0))
            else:
                page.send('stop_hand', question=key)
            while time.monotonic() - max(arm.moved_s, begun_s) < REST_S:
                await asyncio.sleep(0.01)
            times.append(max(0.0, arm.moved_s - begun_s))
    return taken


async def drive(page, key, arm, up):
    """Hold a button until the arm has moved for a while."""
    begun_s = time.monotonic()
    while arm.moved_s < begun_s + 0.5:
        if time.monotonic() > begun_s + 20.0:
            raise RuntimeError('the arm does not move')
        page.send('drive', **wish(key, True, up))
        await asyncio.sleep(0.025)


def wish(key, held, up):
    """The arguments of one command of a held button."""
    return {
        'question': key,
        'frame': 'base',
        'arm': '',
        'sent': 1e3 * time.monotonic(),
        'held': held,
        'linear': [0, 0, up],
        'angular': [0, 0, 0],
        'gripper': '',
    }


class Robots:
    """All that the console is connected with, on a master of its own."""

    def __init__(self, nice):
        """`nice`: of the interfaces, None for their own default."""
        self._nice = nice
        self._processes = []
        self._folder = tempfile.TemporaryDirectory()
        self.port = 0

    def __enter__(self):
        from own_master import wait_for_master

        from smach_oracle.experiment.launching import free_port

        port, self.port = free_port(), free_port()
        os.environ['ROS_MASTER_URI'] = 'http://localhost:{}'.format(port)
        self._start('roscore', '-p', str(port))
        wait_for_master(os.environ['ROS_MASTER_URI'])
        import rospy

        rospy.init_node('benchmark', disable_signals=True)
        with open(os.path.join(FIXTURES, 'teleoperation_arm.urdf'), encoding='utf-8') as file:
            rospy.set_param('robot_description', file.read())
        launch = os.path.join(self._folder.name, 'nodes.launch')
        with open(launch, 'w', encoding='utf-8') as file:
            file.write(LAUNCH.format(fixtures=FIXTURES, port=self.port, nice=self._parameters()))
        self._start('roslaunch', launch)
        for name, robot in (('marking', 'marker'), ('teleoperation', 'driver')):
            self._start(
                sys.executable,
                os.path.join(FIXTURES, 'console_{}_robot.py'.format(name)),
                '__name:=' + robot,
            )
        return self

    def _parameters(self):
        return (
            ''
            if self._nice is None
            else ''.join(
                '<param name="{}_interface/nice" value="{}"/>'.format(name, self._nice)
                for name in ('perception', 'manipulation')
            )
        )

    def _start(self, *command):
        self._processes.append(
            subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        )

    def __exit__(self, *_error):
        import rospy

        rospy.signal_shutdown('measured')
        for process in reversed(self._processes):
            process.send_signal(signal.SIGINT)
        for process in reversed(self._processes):
            try:
                process.wait(15)
            except subprocess.TimeoutExpired:
                process.kill()
        self._folder.cleanup()


@contextlib.contextmanager
def load(processes):
    """So many processes that never rest."""
    started = [multiprocessing.Process(target=never_rest, daemon=True) for _ in range(processes)]
    for each in started:
        each.start()
    try:
        yield
    finally:
        for each in started:
            each.terminate()
            each.join()


def never_rest():
    while True:
        pass


async def measure(options, port, camera, arm):
    """Print all delays; whether they are within the limits."""
    page = await Page(port).open()
    looking = asyncio.get_running_loop().create_task(page.look_on())
    rows, columns = np.nonzero(camera.pixels(CAN_INDEX))
    (left, right), (top, bottom) = (
        (int(each.min()) - 8, int(each.max()) + 8) for each in (columns, rows)
    )
    region = [[left, top], [right, top], [right, bottom], [left, bottom]]
    with load(options.busy):
        taken = await measured_marks(page, options.marks, region)
        taken.update(await measured_stops(page, arm, options.stops))
    looking.cancel()
    print(
        '{} processes that never rest beside {} cores; {} marks, {} stops of each kind'.format(
            options.busy, os.cpu_count(), options.marks, options.stops
        )
    )
    good = True
    for what, times in taken.items():
        limit_s = LIMITS_S[what]
        middle, high, most = 1e3 * np.percentile(times, (50, SHARE, 100))
        good = good and high <= 1e3 * limit_s
        print(
            '{:22s} p50 {:4.0f} ms   p{} {:4.0f} ms   most {:4.0f} ms   limit {:4.0f} ms'.format(
                what, middle, SHARE, high, most, 1e3 * limit_s
            )
        )
    return good


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        '--busy',
        type=int,
        default=os.cpu_count(),
        help='processes that never rest (default: %(default)s)',
    )
    parser.add_argument('--marks', type=int, default=20, help='default: %(default)s')
    parser.add_argument('--stops', type=int, default=10, help='of each kind (default: %(default)s)')
    parser.add_argument('--nice', help='of the interfaces (default: their own)')
    parser.add_argument('--check', action='store_true', help='fail outside of the limits')
    options = parser.parse_args()
    with Robots(options.nice) as robots:
        from console_marking import BOX, CAN, TABLE
        from console_page import ConsolePage
        from published_camera import PublishedCamera
        from teleoperation_fixtures import FakeArm
        from waiting import wait_for

        camera = PublishedCamera('head_camera', [TABLE, CAN, BOX], streams=True)
        arm = FakeArm()
        ConsolePage.port = robots.port
        if not wait_for(ConsolePage.page_is_served, 40.0):
            raise RuntimeError('no console came up')
        good = asyncio.run(measure(options, robots.port, camera, arm))
    return 1 if options.check and not good else 0


if __name__ == '__main__':
    sys.exit(main())
