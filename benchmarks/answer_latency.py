#!/usr/bin/env python3
"""The time from an expert's answer to the robot's next step, over loopback on a real master. It
begins at the call of the answer service, in the expert's process, and ends at the return of `ask`
in the robot's.

    benchmarks/answer_latency.py [--questions N] [--shared] [--check]

--shared puts the server into a third process, as where one serves many robots. The unit is one call
of an empty service over the same way, made by the expert right before each answer: a connection of
its own, expert's process to robot's. --check fails where the median answer takes more than the
limit.
"""

import argparse
import os
import queue
import signal
import statistics
import subprocess
import sys
import threading
import time

LIMIT = 4.0  # empty calls
SHARED = '/shared/expert_query'
OWN = '/latency_robot/expert_query'
EMPTY = '/latency_robot/empty'

sys.path.insert(
    0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'test', 'rostest')
)


def main():
    options = parse()
    if options.role == 'expert':
        return answer_everything(options.server)
    if options.role == 'server':
        return serve()
    with Processes() as processes:
        processes.start_master()
        server = SHARED if options.shared else OWN
        if options.shared:
            processes.start([sys.executable, __file__, '--role', 'server'])
        processes.start([sys.executable, __file__, '--role', 'expert', '--server', server])
        return report(*measure(SHARED if options.shared else '', options.questions), options)


def parse():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--questions', type=int, default=300)
    parser.add_argument('--shared', action='store_true')
    parser.add_argument(
        '--check', action='store_true', help='fail above {:g} empty calls'.format(LIMIT)
    )
    parser.add_argument('--role', default='robot', help=argparse.SUPPRESS)
    parser.add_argument('--server', help=argparse.SUPPRESS)
    return parser.parse_args()


class Processes:
    """Starts a master and others; stops them all."""

    def __init__(self):
        self._started = []

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        for process in reversed(self._started):
            process.send_signal(signal.SIGINT)
        for process in reversed(self._started):
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()

    def start(self, command):
        self._started.append(
            subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        )

    def start_master(self):
        """Start a master on a free port, for us and for all that is started after it; wait until it
        answers.
        """
        from own_master import wait_for_master

        from smach_oracle.experiment.launching import free_port

        port = free_port()
        uri = 'http://localhost:{}'.format(port)
        os.environ['ROS_MASTER_URI'] = uri
        self.start(['roscore', '-p', str(port)])
        wait_for_master(uri)


def measure(server, questions):
    """Latencies of answers, and of empty calls right before them, in seconds."""
    import rospy
    from expert_fixtures import make_question
    from std_srvs.srv import Empty, EmptyResponse

    from smach_oracle.ros.expert.client import ExpertQueryClient

    rospy.init_node('latency_robot', disable_signals=True, log_level=rospy.WARN)
    rospy.Service(EMPTY, Empty, lambda _: EmptyResponse())
    client = ExpertQueryClient(server)
    latencies, calls = [], []
    for number in range(questions + 5):
        question = make_question('q{}'.format(number), deadline_s=30.0)
        answer = client.ask(question, threading.Event(), lambda *_: None)
        returned_s = time.monotonic()
        if answer is None:
            raise RuntimeError('question {} was not answered'.format(number))
        called_s, empty_s = map(float, answer.why.split())
        latencies.append(returned_s - called_s)
        calls.append(empty_s)
    rospy.signal_shutdown('measured')
    return latencies[5:], calls[5:]  # the first ones still make connections


def answer_everything(server):
    """The expert's process: answers each question, with the time of the call as its reason."""
    import rospy
    from std_srvs.srv import Empty

    from smach_oracle.msg import ExpertDecision, OpenQueries
    from smach_oracle.srv import AnswerQuery

    rospy.init_node('latency_expert')
    waiting = queue.Queue()
    rospy.Subscriber(server + '/open', OpenQueries, waiting.put, queue_size=10)
    answered = set()
    while not rospy.is_shutdown():
        try:
            listed = waiting.get(timeout=0.2).queries
        except queue.Empty:
            continue
        for entry in listed:
            if entry.query.query_id in answered:
                continue
            answered.add(entry.query.query_id)
            time.sleep(0.02)  # a person is never faster than the publication of the question
            begun_s = time.monotonic()
            rospy.ServiceProxy(EMPTY, Empty)()
            empty_s = time.monotonic() - begun_s
            proxy = rospy.ServiceProxy(server + '/answer', AnswerQuery)
            decision = ExpertDecision(kind=ExpertDecision.GOTO, state='DETECT', by='ann')
            decision.why = '{!r} {!r}'.format(time.monotonic(), empty_s)
            proxy(entry.query.query_id, decision)
    return 0


def serve():
    import rospy

    from smach_oracle.ros.expert.server import ExpertQueryServer

    rospy.init_node('shared')
    ExpertQueryServer('~expert_query')
    rospy.spin()
    return 0


def report(latencies, calls, options):
    cuts = statistics.quantiles(latencies, n=100, method='inclusive')
    unit_s = statistics.median(calls)
    print(
        '{} answers, {} server: median {:.1f} ms, p95 {:.1f} ms, p99 {:.1f} ms, '
        'slowest {:.1f} ms'.format(
            len(latencies),
            'shared' if options.shared else 'own',
            cuts[49] * 1e3,
            cuts[94] * 1e3,
            cuts[98] * 1e3,
            max(latencies) * 1e3,
        )
    )
    print(
        'an empty call: median {:.1f} ms; an answer takes {:.1f} of them (limit: {:g})'.format(
            unit_s * 1e3, cuts[49] / unit_s, LIMIT
        )
    )
    return int(options.check and cuts[49] > LIMIT * unit_s)


if __name__ == '__main__':
    sys.exit(main())
