#!/usr/bin/env python3
"""Whether the console's page grows with the questions that a person opens and leaves: nodes, event
listeners and heap of a headless Chromium by its DevTools protocol, after garbage collection, on a
real console with a real robot that asks.

    benchmarks/console_growth.py [--questions N] [--every N]

It ends with code 1 where the slope over the questions, fitted by least squares after the first
tenth, is above the limits.
"""
import argparse
import os
import sys
import time

sys.path.insert(
    0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'test', 'rostest'))

# for each question; one has some 400 nodes and 60 listeners
LIMITS = {'nodes': 1.0, 'listeners': 0.1, 'heap bytes': 500.0}
METRICS = {'nodes': 'Nodes', 'listeners': 'JSEventListeners', 'heap bytes': 'JSHeapUsedSize'}


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--questions', type=int, default=2000)
    parser.add_argument('--every', type=int, default=100, help='questions between two samples')
    options = parser.parse_args()
    import rospy
    from answer_latency import Processes
    from console_page import ConsolePage

    class GrowthPage(ConsolePage):
        """The page that is worn."""

    told = quieted()
    with Processes() as processes:
        processes.start_master()
        rospy.init_node('console_growth', disable_signals=True, log_level=rospy.WARN)
        rospy.set_param('/alpha/oracle', {'deadline_s': 7200.0})  # it is one question
        try:
            GrowthPage.begin('console_robot.py', 'PICK', '0.05', '0', '1')
            samples, took_s = measure(GrowthPage.browser, options.questions, options.every, told)
        finally:
            GrowthPage.tearDownClass()
            rospy.signal_shutdown('measured')
    return report(samples, took_s, told)


def quieted():
    """Where to print to; what the nodes say goes nowhere."""
    told = os.fdopen(os.dup(1), 'w', buffering=1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    return told


def measure(browser, questions, every, told):
    """Samples (questions, numbers by name), and s a question of each stretch between them."""
    from console_worn import OPEN_AND_LEAVE
    driver = browser.driver
    driver.set_script_timeout(3600)
    driver.execute_cdp_cmd('Performance.enable', {})
    browser.find('.question-row.pending')
    samples, took_s = [(0, numbers_of(driver))], []
    for done in range(every, questions + 1, every):
        began_s = time.monotonic()
        driver.execute_async_script(OPEN_AND_LEAVE, every)
        took_s.append((time.monotonic() - began_s) / every)
        samples.append((done, numbers_of(driver)))
        print('{:5d} questions  {}  {:.0f} ms each'.format(
            done, '  '.join('{} {:.0f}'.format(name, value)
                            for name, value in samples[-1][1].items()), 1e3 * took_s[-1]),
              file=told)
    return samples, took_s


def numbers_of(driver):
    for _ in range(2):
        driver.execute_cdp_cmd('HeapProfiler.collectGarbage', {})
    found = {metric['name']: metric['value']
             for metric in driver.execute_cdp_cmd('Performance.getMetrics', {})['metrics']}
    return {name: found[metric] for name, metric in METRICS.items()}


def report(samples, took_s, told):
    """Print the slopes; returns the exit code."""
    warm = samples[max(1, len(samples) // 10):]
    grows = False
    for name, limit in LIMITS.items():
        slope = slope_of([(done, numbers[name]) for done, numbers in warm])
        grows |= slope > limit
        print('{:10s}  {:+9.3f} a question  (limit {:g})  {:.0f} first, {:.0f} last'.format(
            name, slope, limit, warm[0][1][name], warm[-1][1][name]), file=told)
    print('time: {:.0f} ms a question at first, {:.0f} ms at last'.format(
        1e3 * took_s[0], 1e3 * took_s[-1]), file=told)
    return int(grows)


def slope_of(points):
    """Of the line through some points with the least squares."""
    middle_x = sum(x for x, _ in points) / len(points)
    middle_y = sum(y for _, y in points) / len(points)
    return sum((x - middle_x) * (y - middle_y) for x, y in points) / sum(
        (x - middle_x)**2 for x, _ in points)


if __name__ == '__main__':
    sys.exit(main())
