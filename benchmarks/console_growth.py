#!/usr/bin/env python3
"""Whether the console's page grows with the questions that a person opens and leaves: nodes, event
listeners and heap of a headless Chromium by its DevTools protocol, after garbage collection, on a
real console with a real robot that asks.

    benchmarks/console_growth.py [--questions N] [--every N] [--warm-up N]

It ends with code 1 where growth a question, the median of the slopes between any two samples, is
above a limit. The questions of the warm-up are not counted: meanwhile the browser compiles what is
used often, which takes heap, too.
"""

import argparse
import os
import sys
import time

sys.path.insert(
    0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'test', 'rostest')
)

# for each question; one has some 400 nodes and 60 listeners
LIMITS = {'nodes': 1.0, 'listeners': 0.1, 'heap bytes': 500.0}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--questions', type=int, default=2000)
    parser.add_argument('--every', type=int, default=100, help='questions between two samples')
    parser.add_argument('--warm-up', type=int, default=200, help='questions before the first one')
    options = parser.parse_args()
    import rospy
    from answer_latency import Processes
    from console_page import ConsolePage

    class GrowthPage(ConsolePage):
        """The page that is worn."""

        whole_browser = True

    told = quieted()
    with Processes() as processes:
        processes.start_master()
        rospy.init_node('console_growth', disable_signals=True, log_level=rospy.WARN)
        rospy.set_param('/alpha/oracle', {'expert': {'deadline_s': 7200.0}})  # it is one question
        try:
            GrowthPage.begin('console_robot.py', 'PICK', '0.05', '0', '1')
            GrowthPage.browser.find('.question-row.pending')
            taken = measure(GrowthPage.browser.driver, options, told)
        finally:
            GrowthPage.tearDownClass()
            rospy.signal_shutdown('measured')
    return report(taken, told)


def quieted():
    """Silence the nodes, and return a stream to the old standard output."""
    told = os.fdopen(os.dup(1), 'w', buffering=1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    return told


def measure(driver, options, told):
    """Samples: questions, numbers by name."""
    from page_growth import samples

    taken, began_s = [], time.monotonic()
    for done, numbers in samples(driver, options.warm_up, options.questions, options.every):
        taken.append((done, numbers))
        print(
            '{:5d} questions  {}  {:.0f} s'.format(
                done,
                '  '.join('{} {:.0f}'.format(name, value) for name, value in numbers.items()),
                time.monotonic() - began_s,
            ),
            file=told,
        )
    return taken


def report(taken, told):
    """Print the growth; returns the exit code."""
    from page_growth import slopes_of

    grows = False
    for name, slope in slopes_of(taken).items():
        grows |= slope > LIMITS[name]
        print(
            '{:10s}  {:+9.3f} a question  (limit {:g})  {:.0f} first, {:.0f} last'.format(
                name, slope, LIMITS[name], taken[0][1][name], taken[-1][1][name]
            ),
            file=told,
        )
    return int(grows)


if __name__ == '__main__':
    sys.exit(main())
