#!/usr/bin/env python3
"""Take the pictures of the operator console anew: a real console, a real machine under a real
oracle, a headless Chromium.

    python3 doc/draw_console.py [--to FOLDER]

It writes console_question.png and console_machine.png. It starts a ROS master of its own. The other
pictures of the console show the simulated robot, or a trial from its bag: they are taken by hand.
"""
import argparse
import os
import sys

DOC = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(DOC, '..', folder) for folder in ('test/rostest', 'benchmarks')]

SIZE = (1280, 900)
MOST_BYTES = 200000  # of a picture
QUESTION = '.question-row[data-key^="/alpha/"]'


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--to', default=os.path.join(DOC, 'images'), help='folder of the pictures')
    folder = parser.parse_args().to
    import rospy
    from answer_latency import Processes
    from console_page import ConsolePage

    class DrawnPage(ConsolePage):
        """The page of which pictures are taken."""

    with Processes() as processes:
        processes.start_master()
        rospy.init_node('draw_console', disable_signals=True, log_level=rospy.WARN)
        rospy.set_param('/alpha/reason', 'no grasp found: the handle points to the wall')
        try:
            DrawnPage.begin('console_robot.py', 'PICK', '0.4', '2', '9', size=SIZE, name='ann')
            draw(DrawnPage.browser, folder)
        finally:
            DrawnPage.tearDownClass()
            rospy.signal_shutdown('drawn')


def draw(browser, folder):
    """Work through a question, and take a picture at each place."""
    browser.click(QUESTION)
    expect(browser, 'It is yours.')
    browser.find('.choice.goto[data-settled]')
    take(browser, folder, 'console_question')
    browser.click('.choice.goto[data-name=DETECT]')
    expect(browser, 'It asks again')
    browser.click('#tab-machines')
    browser.click('.path[title="KITCHEN/FETCH"]')
    browser.find('[id="/alpha/KITCHEN/FETCH/PICK"].failed')
    browser.click('[data-action=pause-machine]')
    expect(browser, 'Paused by ann')
    browser.find('[data-action=resume-machine][data-settled]')
    take(browser, folder, 'console_machine')


def expect(browser, words):
    """Wait until the page says so.

    :raises AssertionError: where it does not.
    """
    if not browser.says(words):
        raise AssertionError('the page does not say {!r}; it says:\n{}'.format(
            words, browser.text()))


def take(browser, folder, name):
    """Write a picture, with few colours.

    :raises AssertionError: where it is too large for a document.
    """
    from PIL import Image
    path = os.path.join(folder, name + '.png')
    browser.run('document.querySelectorAll("#toasts > *").forEach((each) => each.remove())')
    browser.screenshot(path, *SIZE)
    Image.open(path).convert('RGB').quantize(200).save(path, optimize=True)
    if os.path.getsize(path) > MOST_BYTES:
        raise AssertionError('{} has {} bytes'.format(path, os.path.getsize(path)))


if __name__ == '__main__':
    main()
