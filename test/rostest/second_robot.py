#!/usr/bin/env python3
"""The wheeled robot without arms, by its launch file: a wet floor ends its tour, unless there is an
oracle; a person reads the gauge from the picture on the console.
"""

import json
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Any, List

import rosbag
import rospy
import tornado.httpclient
import tornado.ioloop
import tornado.websocket
from waiting import wait_for

from smach_oracle.analysis.counting.trial_summary import TrialSummary
from smach_oracle.analysis.trials import load_trials
from smach_oracle.experiment.launching import free_port
from smach_oracle.inspection_robot.world.causes import draw
from smach_oracle.msg import ExpertDecision, FailureFrames, OpenQueries, UserdataItem
from smach_oracle.srv import AnswerQuery

CAMERA = '/camera/image_raw'
AT_PLACE = 'inspection/TOUR/AT_PLACE/'
# the puddle that turns the robot most: it lies in the middle of a long way
PUDDLE = (4.4, 3.2)


def wet_seed() -> int:
    """The first seed with a large, slippery puddle there."""
    for seed in range(10000):
        wet = draw(seed, only=['wet_floor']).wet
        if wet and (wet.x, wet.y) == PUDDLE and wet.radius > 0.65 and abs(wet.drift) > 0.6:
            return seed
    raise AssertionError('no seed has such a puddle')


class SecondRobot(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, str(self.folder), ignore_errors=True)
        if rospy.has_param('/inspection'):  # of the launch before
            rospy.delete_param('/inspection')

    def launch(self, *arguments: str) -> 'subprocess.Popen[bytes]':
        """Start the launch file on a wet floor, four times as fast as real time."""
        process = subprocess.Popen(
            [
                'roslaunch',
                'smach_oracle',
                'inspection.launch',
                'speed:=4',
                'causes:=wet_floor',
                'seed:={}'.format(wet_seed()),
                'record:={}'.format(self.folder),
                'truth:={}'.format(self.folder / 'truth.jsonl'),
                *arguments,
            ]
        )
        self.addCleanup(self.stop, process)
        return process

    def stop(self, process: 'subprocess.Popen[bytes]') -> None:
        """As Ctrl-C does, where it still runs."""
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            process.wait(40)

    def told(self, process: 'subprocess.Popen[bytes]') -> Any:
        """What the world says of the trial, once it is over: success, causes."""
        process.wait(120)
        (line,) = (self.folder / 'truth.jsonl').read_text(encoding='utf-8').splitlines()
        return json.loads(line)

    def trial(self) -> TrialSummary:
        (summary,) = load_trials([str(self.folder)]).trials
        self.assertEqual(summary.lost_events, 0)
        return summary

    def bag(self) -> rosbag.Bag:
        (path,) = self.folder.glob('*.bag')
        bag = rosbag.Bag(str(path))
        self.addCleanup(bag.close)
        return bag

    def test_bare_it_ends_where_its_author_foresaw_nothing(self) -> None:
        told = self.told(self.launch('with_oracle:=false'))
        self.assertEqual((told['success'], told['damage']['count']), (False, 0))
        (cause,) = told['causes']
        self.assertEqual(
            (cause['kind'], cause['began_s'], cause['lasting']), ('wet_floor', 0, True)
        )
        trial = self.trial()
        self.assertEqual((trial.outcome, trial.recoveries, trial.questions), ('aborted', 0, 0))
        self.assertEqual(trial.cause and trial.cause.kinds, ('wet_floor',))
        self.assertEqual(dict(trial.failures_by_state)[AT_PLACE + 'INSPECT'], 1)

    def test_with_the_oracle_it_finds_its_way_back_and_reads_all_gauges(self) -> None:
        told = self.told(self.launch())
        self.assertEqual((told['success'], told['why']), (True, ''))
        trial = self.trial()
        self.assertEqual((trial.outcome, trial.questions), ('succeeded', 0))
        self.assertGreater(trial.recoveries, 0)
        reports = [
            message.data[:8] for _, message, _ in self.bag().read_messages('/inspection/report')
        ]
        self.assertEqual(reports, ['panel 1:', 'panel 2:', 'panel 3:'])

    def test_a_person_sees_the_camera_and_gives_the_reading(self) -> None:
        port = free_port()
        asked: List[OpenQueries] = []
        frames: List[FailureFrames] = []
        rospy.Subscriber('/inspection/expert_query/open', OpenQueries, asked.append)
        rospy.Subscriber('/inspection/failure_frames', FailureFrames, frames.append)
        process = self.launch(
            'console:=true', 'console_port:={}'.format(port), 'oracle:={max_recoveries: 0}'
        )
        self.assertTrue(wait_for(lambda: asked and asked[-1].queries, 90.0), 'nobody is asked')
        self.assertTrue(wait_for(lambda: frames), 'no picture comes with the question')
        self.assertEqual((frames[-1].topics, len(frames[-1].images)), ([CAMERA], 1))
        self.assertEqual(
            tornado.ioloop.IOLoop().run_sync(lambda: kind_of(CAMERA, port), 60.0), 'image'
        )
        query = asked[-1].queries[0].query
        self.assertEqual((query.failed_state, query.container_path + '/'), ('INSPECT', AT_PLACE))
        answer = rospy.ServiceProxy('/inspection/expert_query/answer', AnswerQuery)
        reading = UserdataItem(key='reading', encoding=UserdataItem.JSON, value=b'4.25')
        response = answer(
            query.query_id,
            ExpertDecision(
                kind=ExpertDecision.SUPERSEDE, outcome='succeeded', outputs=[reading], by='ann'
            ),
        )
        self.assertTrue(response.ok, response.message)
        self.assertIn('panel 2 was reported as 4.25', self.told(process)['why'])
        self.assertEqual((self.trial().outcome, self.trial().answered), ('succeeded', 1))


async def kind_of(topic: str, port: int) -> str:
    """As what the console lists a topic among its sensors, by the socket of its page."""
    origin = 'http://localhost:{}'.format(port)
    session = await tornado.httpclient.AsyncHTTPClient().fetch(origin + '/session')
    cookie = session.headers['Set-Cookie'].split(';')[0]
    page = await tornado.websocket.websocket_connect(
        tornado.httpclient.HTTPRequest(
            origin.replace('http', 'ws', 1) + '/socket',
            headers={'Origin': origin, 'Cookie': cookie},
        )
    )
    hello = {'do': 'hello', 'xsrf': json.loads(session.body)['xsrf'], 'expert': 'ann', 'id': 1}
    await page.write_message(json.dumps(hello))
    while True:
        message = json.loads(await page.read_message())
        for sensor in found_in(message, 'sensors'):
            if sensor['topic'] == topic:
                return str(sensor['kind'])


def found_in(message: Any, name: str) -> List[Any]:
    """The list of that name, however deep it lies in a message of the console."""
    if not isinstance(message, dict):
        return []
    if isinstance(message.get(name), list):
        return list(message[name])
    return [each for value in message.values() for each in found_in(value, name)]


if __name__ == '__main__':
    import rostest

    rospy.init_node('second_robot')
    rostest.rosrun('smach_oracle', 'second_robot', SecondRobot, sys.argv)
