#!/usr/bin/env python3
"""Take the pictures of the operator console again: a real console, real machines under a real
oracle, the simulated PR2, a headless Chromium.

    python3 doc/draw_console.py [--to FOLDER] [--of kitchen|pr2|recording]

`recording` writes recovery.gif: a failure, a question, an answer and success. `kitchen` has seven
robots, and writes console_robots.png, console_question.png and console_machine.png. `pr2` writes
console_perception.png, console_last_seconds.png, console_hand.png, console_3d.png and
console_replay.png. Each starts a ROS master of its own. Look at what they have drawn.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile

DOC = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(DOC, '..', folder) for folder in ('test/rostest', 'benchmarks')]

SIZE = (1400, 900)
MOST_BYTES = 200000  # of a picture
MOST_BYTES_MOVING = 1500000
REASON = 'no grasp found: the handle points to the wall'
# robots beside /alpha: arguments of console_robot.py, and why their state fails
OTHERS = {
    'bravo': (('DETECT', '0.4', '2', '9'), 'no mug in sight'),
    'charlie': (('PLACE', '0.4', '2', '9'), 'the shelf is full'),
    'delta': (('PICK', '0.4', '2', '9'), 'no grasp found: the mug stands too far away'),
    'echo': (('NONE', '4', '2', '9', '0.1'), ''),
    'foxtrot': (('NONE', '4', '2', '9', '0.1'), ''),
    'golf': (('NONE', '4', '2', '9', '0.1'), ''),
}
CARD = '.fleet-card[data-robot="/{}"]'
QUESTION = '.question-row.pending[data-key^="/{}/"]'
CAMERA = '/head_camera/rgb/image_raw'
CLOUD = '/head_camera/depth_registered/points'
TABLE, HAND = (0.7, -0.05, 0.7), (0.55, -0.4, 0.85)  # m in base_footprint, to look at
MARKED = ((0.27, 0.44), (0.405, 0.69))  # two corners around an object, as shares of the image
BEFORE_S = 6.0  # the moment of the replay that is shown, before the failure
SEEK = """
const slider = document.querySelector(".last-seconds [data-replay=scrubber]");
slider.value = -arguments[0];
slider.dispatchEvent(new Event("input"));"""
PICTURED = """
const view = document.querySelector(arguments[0]);
if (!view || view.width < 100) return false;
const { data } = view.getContext("2d").getImageData(0, 0, view.width, view.height);
return new Set(data).size > 50;"""


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--to', default=os.path.join(DOC, 'images'), help='folder of the pictures')
    parser.add_argument('--of', choices=['kitchen', 'pr2', 'recording'], help='default: all')
    options = parser.parse_args()
    if not options.of:  # a process has one ROS node only
        for each in ('kitchen', 'pr2', 'recording'):
            subprocess.run([sys.executable, __file__, '--to', options.to, '--of', each], check=True)
        return
    from answer_latency import Processes

    with Processes() as processes:
        processes.start_master()
        {'kitchen': draw_kitchen, 'pr2': draw_pr2, 'recording': record_answer}[options.of](
            processes, options.to
        )


def draw_kitchen(_processes, folder):
    """All robots, a question of one, and its machine that is paused."""
    import rospy
    from console_page import HERE, ConsolePage, Node

    class KitchenPage(ConsolePage):
        """The page of which pictures are taken."""

        whole_browser = True

    rospy.init_node('draw_console', disable_signals=True, log_level=rospy.WARN)
    rospy.set_param('/alpha/reason', REASON)
    parts = publish_health()
    others = []
    try:
        KitchenPage.begin('console_robot.py', 'PICK', '0.4', '2', '9', size=SIZE, name='ann')
        resize(KitchenPage.browser)
        for name, (arguments, reason) in OTHERS.items():
            rospy.set_param('/{}/reason'.format(name), reason)
            robot = os.path.join(HERE, 'console_robot.py')
            others.append(Node(sys.executable, robot, *arguments, '__name:=' + name))
        show_fleet(KitchenPage.browser, folder)
        work_in_kitchen(KitchenPage.browser, folder)
    finally:
        for each in others:
            each.stop()
        for each in parts:
            each.unregister()
        KitchenPage.tearDownClass()
        rospy.signal_shutdown('drawn')


def record_answer(_processes, folder):
    """The console from a failure to the machine's success, as a GIF."""
    import rospy
    from console_page import ConsolePage

    class RecordedPage(ConsolePage):
        """The page that is recorded."""

        whole_browser = True

    rospy.init_node('draw_console', disable_signals=True, log_level=rospy.WARN)
    rospy.set_param('/alpha/reason', REASON)
    frames = []  # PNG and s that it is shown
    try:
        RecordedPage.begin(
            'console_robot.py', 'PICK', '1.2', '0', '1', size=(1200, 760), name='ann'
        )
        browser = RecordedPage.browser

        def shoot(shown_s):
            frames.append((browser.driver.get_screenshot_as_png(), shown_s))

        browser.click('#tab-machines')
        browser.click('.path[title="KITCHEN/FETCH"]')
        browser.find('[id="/alpha/KITCHEN/FETCH/PICK"].failed')
        shoot(2.5)
        browser.click('#tab-questions')
        browser.click(QUESTION.format('alpha'))
        browser.click('[data-action=claim]')
        expect(browser, 'It is yours.')
        browser.find('.choice.goto[data-settled]')
        shoot(4.0)
        browser.click('.choice.goto[data-name=PLACE]')
        shoot(1.5)
        browser.click('#tab-machines')
        browser.click('.path[title="KITCHEN/FETCH"]')
        for _ in range(8):
            shoot(0.6)
            rospy.rostime.wallsleep(0.4)
        shoot(3.0)
    finally:
        RecordedPage.tearDownClass()
        rospy.signal_shutdown('recorded')
    write_gif(frames, os.path.join(folder, 'recovery.gif'))


def write_gif(frames, path):
    """Put screenshots into one picture that moves, each shown for its s."""
    import io

    from PIL import Image

    pictures = [
        Image.open(io.BytesIO(data))
        .convert('RGB')
        .resize((900, 570), Image.LANCZOS)
        .quantize(64, dither=Image.NONE)
        for data, _ in frames
    ]
    pictures[0].save(
        path,
        save_all=True,
        append_images=pictures[1:],
        loop=0,
        optimize=True,
        duration=[round(1000 * shown_s) for _, shown_s in frames],
    )
    assert os.path.getsize(path) < MOST_BYTES_MOVING, path


def publish_health():
    """Batteries and diagnostics of some robots; the publishers, which must be kept."""
    import rospy
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
    from sensor_msgs.msg import BatteryState

    charges = {'alpha': 0.81, 'delta': 0.57, 'echo': 0.12, 'golf': 0.94}
    publishers = []
    for name, charge in charges.items():
        topic = '/{}/battery'.format(name)
        publishers.append(rospy.Publisher(topic, BatteryState, queue_size=1, latch=True))
        publishers[-1].publish(percentage=charge, voltage=21.0 + 4.0 * charge)
    publishers.append(rospy.Publisher('/diagnostics', DiagnosticArray, queue_size=1, latch=True))
    motor = DiagnosticStatus(
        level=DiagnosticStatus.WARN, name='foxtrot: left motor', message='temperature 71 °C'
    )
    publishers[-1].publish(status=[motor])
    return publishers


def show_fleet(browser, folder):
    """All robots, one of them paused."""
    browser.click('#tab-fleet')
    for name, (_, reason) in OTHERS.items():
        expect(browser, 'needs an answer' if reason else 'est. ', CARD.format(name))
    expect(browser, 'needs an answer', CARD.format('alpha'))
    expect(browser, 'temperature', CARD.format('foxtrot'))
    expect(browser, 'Battery low', CARD.format('echo'))
    browser.click(CARD.format('golf') + ' [data-action=pause-robot]')
    expect(browser, 'in KITCHEN will run', CARD.format('golf'))
    browser.find(CARD.format('golf') + ' [data-action=resume-robot][data-settled]')
    take(browser, folder, 'console_robots')
    browser.click('#tab-questions')


def work_in_kitchen(browser, folder):
    """Work through a question, and take a picture at each place."""
    browser.click(QUESTION.format('alpha'))
    browser.click('[data-action=claim]')
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


def draw_pr2(processes, folder):
    """A trial of the simulated PR2, seen and handled by a person, and replayed from its bag."""
    import rospy
    from console_page import ConsolePage, Node

    processes.start(
        [
            'roslaunch',
            'smach_oracle',
            'pr2.launch',
            'scripted_operator:=false',
            'benign:=true',
            'real_time_factor:=1',
        ]
    )
    bags = tempfile.mkdtemp()

    class RobotPage(ConsolePage):
        """The page of which pictures are taken, beside the simulated PR2."""

        whole_browser = True

        @classmethod
        def start_robot(cls, robot, *arguments):
            return Node(sys.executable, os.path.join(DOC, robot), '__name:=pr2')

        @classmethod
        def start_console(cls, *more):
            return super().start_console('_bags:=' + bags, *more)

    rospy.init_node('draw_console', disable_signals=True, log_level=rospy.WARN)
    look_at(TABLE)
    rospy.set_param('/expert_console/cameras', {'/pr2': ['/head_camera']})
    rospy.set_param('/pr2/record', bags)
    rospy.set_param('/pr2/failure_cameras', [CAMERA])
    try:
        RobotPage.begin('draw_console_robot.py', size=SIZE, name='ann')
        resize(RobotPage.browser)
        mark_an_object(RobotPage.browser, folder)
        look_at(HAND)
        go_through_last_seconds(RobotPage.browser, folder)
        drive_the_hand(RobotPage.browser, folder)
        look_in_3d(RobotPage.browser, folder)
        RobotPage.console.stop()
        expect(RobotPage.browser, 'connection lost')
        RobotPage.console = RobotPage.start_console()
        replay(RobotPage.browser, folder)
    finally:
        RobotPage.tearDownClass()
        rospy.signal_shutdown('drawn')
        shutil.rmtree(bags)


def look_at(place):
    """Return when the head does; it waits for the simulation to come up."""
    import actionlib
    from geometry_msgs.msg import Point, PointStamped, Vector3
    from std_msgs.msg import Header

    from control_msgs.msg import PointHeadAction, PointHeadGoal

    head = actionlib.SimpleActionClient('/head_traj_controller/point_head_action', PointHeadAction)
    if not head.wait_for_server():
        raise RuntimeError('the simulated head is not there')
    head.send_goal_and_wait(
        PointHeadGoal(
            target=PointStamped(Header(frame_id='base_footprint'), Point(*place)),
            pointing_axis=Vector3(0, 0, 1),
            pointing_frame='wide_stereo_optical_frame',
        )
    )


def mark_an_object(browser, folder):
    """Answer the first question in the image of the failure."""
    from selenium.webdriver.common.action_chains import ActionChains

    browser.click(QUESTION.format('pr2'), 120.0)
    browser.click('.choice.interface[data-name=perception]')
    browser.find('.perception.shown', 60.0)
    canvas = browser.find('.perception .drawing')
    browser.run('arguments[0].closest(".perception").scrollIntoView()', canvas)
    wide, high = canvas.size['width'], canvas.size['height']
    first, last = ((int((x - 0.5) * wide), int((y - 0.5) * high)) for x, y in MARKED)
    action = ActionChains(browser.driver, duration=20)
    action.move_to_element_with_offset(canvas, *first).click_and_hold()
    action.move_to_element_with_offset(canvas, *last).release().perform()
    browser.find('[data-fact=size]')
    expect_robot(browser, '.object-view')
    browser.find('.accept[data-settled], [data-settled] .accept')
    take(browser, folder, 'console_perception')
    browser.click('.perception .accept')


def go_through_last_seconds(browser, folder):
    """The second question, with what came before its failure."""
    browser.click(QUESTION.format('pr2'), 60.0)
    browser.find('.last-seconds:not([hidden])')
    until(lambda: browser.text('.last-seconds h3').startswith('Last 30 s'), '30 s')
    browser.run(SEEK, BEFORE_S)
    until(lambda: browser.run(PICTURED, '.last-seconds canvas.image'), 'the image before')
    browser.run('document.querySelector(".last-seconds").scrollIntoView({ block: "center" })')
    take(browser, folder, 'console_last_seconds')


def drive_the_hand(browser, folder):
    """Answer the second question with the hand, which goes up in the picture."""
    from selenium.webdriver.common.action_chains import ActionChains

    scheme(browser, 'dark')
    browser.click('.choice.interface[data-name=manipulation]')
    browser.find('.manipulation', 60.0)
    browser.click('.manipulation .wheel')
    expect(browser, 'You drive.', '.driver')
    browser.click('[data-arm=right]')
    browser.click('[data-frame=base]')
    until(lambda: browser.run(PICTURED, '.drive-stage canvas'), 'the camera')
    browser.click('[data-view$=robot_description]')
    expect_robot(browser, '.drive-stage')
    browser.run('document.querySelector(".manipulation").scrollIntoView()')
    browser.hold('r')
    until(lambda: 'mm/s' in browser.text('.manipulation'), 'the hand moves')
    take(browser, folder, 'console_hand')
    ActionChains(browser.driver, duration=0).key_up('r').perform()
    browser.click('.finish')
    expect(browser, 'PICK counts as having ended with succeeded.', '.follow-up')


def look_in_3d(browser, folder):
    """The robot with what its camera sees."""
    browser.click('#tab-sensors')
    browser.click('.sensor-list [data-topic="{}"]'.format(CLOUD))
    expect(browser, 'of 307200 points', '.cloud-view')
    expect_robot(browser, '.cloud-view')
    take(browser, folder, 'console_3d')
    browser.click('.cloud-view .view-close')
    scheme(browser, 'light')


def replay(browser, folder):
    """The trial from its bag, as it stood when the second question was answered."""
    from selenium.webdriver.common.keys import Keys

    expect(browser, 'live', '#status')
    browser.click('#tab-trials')
    browser.click('.trial[data-number]', 60.0)
    slider = browser.find('.replay [role=slider]')
    slider.send_keys(Keys.HOME)
    for _ in range(12):
        slider.send_keys(Keys.PAGE_UP)
        if all(
            browser.says(words, '.replay-question', 1.0)
            for words in ('Question about PICK', 'Answer of ann')
        ):
            break
    until(lambda: browser.run(PICTURED, '.replay-images .shown canvas'), 'what was seen')
    take(browser, folder, 'console_replay')


def scheme(browser, name):
    """`light` or `dark`, as a system that prefers it."""
    browser.driver.execute_cdp_cmd(
        'Emulation.setEmulatedMedia',
        {'features': [{'name': 'prefers-color-scheme', 'value': name}]},
    )


def resize(browser):
    """From here on the page has the size of the pictures, so that none of them moves it."""
    with tempfile.TemporaryDirectory() as folder:
        browser.screenshot(os.path.join(folder, 'first.png'), *SIZE)


def until(is_so, what, limit_s=60.0):
    """Wait for it.

    :raises AssertionError: where it does not come.
    """
    from waiting import wait_for

    if not wait_for(is_so, limit_s):
        raise AssertionError('the page does not show ' + what)


def expect_robot(browser, view):
    """Wait until a view in 3D shows the robot."""
    script = 'return Number(document.querySelector(arguments[0])?.dataset.triangles || 0) > 10000'
    until(lambda: browser.run(script, view + ' .cloud'), 'the robot in 3D')


def expect(browser, words, selector='body'):
    """Wait until the page says so.

    :raises AssertionError: where it does not.
    """
    if not browser.says(words, selector, 60.0):
        raise AssertionError(
            'the page does not say {!r}; it says:\n{}'.format(words, browser.text())
        )


def take(browser, folder, name):
    """Write a picture, with few colours.

    :raises AssertionError: where it is too large for a document.
    """
    from PIL import Image

    path = os.path.join(folder, name + '.png')
    browser.run('document.querySelectorAll("#toasts > *").forEach((each) => each.remove())')
    browser.screenshot(path, *SIZE)
    whole = Image.open(path).convert('RGB')
    for mixed in (128, 64, 32):
        in_few_colours(whole, mixed).save(path, optimize=True)
        if os.path.getsize(path) <= MOST_BYTES:
            return
    raise AssertionError('{} has {} bytes'.format(path, os.path.getsize(path)))


def in_few_colours(whole, mixed):
    """Those of the page as they are, those of a camera's image by the nearest of so many."""
    from PIL import Image

    counted = sorted(whole.getcolors(whole.width * whole.height), reverse=True)
    frequent = [value for _, colour in counted[:128] for value in colour]
    others = whole.quantize(mixed, method=Image.FASTOCTREE).getpalette()[: 3 * mixed]
    palette = Image.new('P', (1, 1))
    palette.putpalette(frequent + others)
    return whole.quantize(palette=palette, dither=0)


if __name__ == '__main__':
    main()
