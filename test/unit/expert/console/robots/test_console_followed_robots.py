"""Robots are found by their topics, which become sections."""

from waiting import wait_for

from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from smach_oracle.expert import robot_topics
from smach_oracle.expert.console.robots import followed_robots
from smach_oracle.expert.console.robots.followed_robot import FollowedRobot
from smach_oracle.expert.console.sensors.robot_clocks import RobotClocks
from smach_oracle.expert.console.trials.trial_log import TrialLog
from smach_oracle.expert.console.web.sections import PageSections
from smach_oracle.msg import OracleEvent, OracleRates, StateRate, TransitionCount


class NoLayouts:
    def find(self, text, done):
        return None


def test_a_robot_s_topics_become_its_sections():
    robot, sections = FollowedRobot('/robot'), PageSections()
    robot.on_structure(
        SmachContainerStructure(
            path='/TASK',
            children=['A', 'B'],
            outcomes_from=['A'],
            internal_outcomes=['ok'],
            outcomes_to=['B'],
            container_outcomes=['done'],
        )
    )
    robot.on_structure(SmachContainerStructure(path='/TASK/B', children=['C']))
    robot.on_status(SmachContainerStatus(path='/TASK', active_states=['B']))
    robot.on_rates(
        OracleRates(
            states=[
                StateRate('TASK', 'A', 0.25, 1, 3, 1, 0, False),
                StateRate('UNSEEN', 'X', 0.1, 1, 0, 0, 0, False),
            ],
            transitions=[TransitionCount('TASK', 'A', 'ok', 'B', 3)],
        )
    )
    robot.on_event(OracleEvent(kind=OracleEvent.FAILURE, path='TASK', state='A', rate=0.25))
    robot.write_sections(sections, NoLayouts())
    live = sections.get('live /robot')
    assert live['active'] == {'TASK': ['B']} and live['failed']['TASK']['state'] == 'A'
    assert live['rates']['TASK']['A']['rate'] == 0.25 and live['counts']['TASK'] == [
        ['A', 'ok', 'B', 3, 1.0]
    ]
    assert live['paths'] == ['TASK', 'TASK/B', 'UNSEEN'], (
        'without introspection what is learned shows a machine'
    )
    assert [state['nested'] for state in sections.get('graph /robot TASK')['states']] == [
        False,
        True,
    ]
    robot.on_event(OracleEvent(kind=OracleEvent.JUMP, path='TASK', state='A', target='B'))
    robot.write_sections(sections, NoLayouts())
    assert sections.get('live /robot')['failed'] == {}
    robot.forget(sections)
    assert sections.since(0)[1] == []


def test_a_robot_that_waits_to_be_well_says_so_until_it_goes_on_or_its_trial_is_over():
    robot, sections = FollowedRobot('/robot'), PageSections()

    def unwell_after(kind, text=''):
        robot.on_event(OracleEvent(kind=kind, path='TASK', state='A', text=text))
        robot.write_sections(sections, NoLayouts())
        return sections.get('live /robot')['unwell']

    assert unwell_after(OracleEvent.STATE_START) == ''
    for end in (OracleEvent.HEALTH_WAIT_END, OracleEvent.TRIAL_END, OracleEvent.TRIAL_START):
        assert unwell_after(OracleEvent.HEALTH_WAIT_START, 'motors: off') == 'motors: off'
        assert unwell_after(OracleEvent.STATE_START) == 'motors: off', 'another branch runs'
        assert unwell_after(end) == ''


class FakeSubscriber:
    made, unregistered = [], []

    def __init__(self, topic, message, callback, queue_size, buff_size=65536, tcp_nodelay=False):
        self.topic, self.callback, self.buff_size = topic, callback, buff_size
        self.made.append(self)

    def unregister(self):
        self.unregistered.append(self.topic)


def test_robots_are_found_by_name_and_type_and_the_oldest_of_many_that_are_gone_are_forgotten(
    monkeypatch,
):
    monkeypatch.setattr(followed_robots.rospy, 'Subscriber', FakeSubscriber)
    monkeypatch.setattr(followed_robots, 'MOST_ROBOTS', 2)
    sections, log = PageSections(), TrialLog()
    found = followed_robots.FollowedRobots(sections, log, NoLayouts())
    events = OracleEvent._type
    found.follow(
        [
            ['/a/oracle/events', events],
            ['/b/oracle/events', 'std_msgs/String'],
            ['/c/other', events],
            ['/oracle/events', events],
        ]
    )
    found.write_sections()
    assert sections.get('robots') == ['/a']
    next(each for each in FakeSubscriber.made if each.topic == '/a/oracle/events').callback(
        OracleEvent(kind=OracleEvent.STATE_START, trial_id='t', path='TASK', state='A')
    )
    found.write_sections()
    assert sections.get('live /a')['alive'] and log.overview()['trials'][0]['robot'] == '/a'
    for name in 'defg':
        found.follow([['/{}/oracle/events'.format(name), events]])
    found.follow([])
    found.follow([])
    found.write_sections()
    assert sections.get('robots') == ['/f', '/g'] and sections.get('live /a') is None
    assert (
        '/a/oracle/events' in FakeSubscriber.unregistered and not sections.get('live /g')['alive']
    )


def test_the_clock_of_a_robot_that_is_gone_is_forgotten(monkeypatch):
    monkeypatch.setattr(followed_robots.rospy, 'Subscriber', FakeSubscriber)
    clocks = RobotClocks()
    found = followed_robots.FollowedRobots(PageSections(), TrialLog(), NoLayouts(), clocks)
    here = [['/here/oracle/events', OracleEvent._type]]
    found.follow(here + [['/simulated/oracle/events', OracleEvent._type]])
    clocks.take('/here', 9000.0)
    clocks.take('/simulated', 12.0)
    assert clocks.shared_now_s() is None
    for _ in range(2):
        found.follow(here)
    assert clocks.robots() == ['/here'] and clocks.shared_now_s() >= 9000.0


def test_a_connection_waits_with_a_small_buffer(monkeypatch):
    """What is left of large ones, one for each connection, comes to fill the heap."""
    monkeypatch.setattr(followed_robots.rospy, 'Subscriber', FakeSubscriber)
    monkeypatch.setattr(robot_topics.rosgraph, 'is_master_online', lambda: True)
    monkeypatch.setattr(FakeSubscriber, 'made', [])
    followed_robots.FollowedRobots(PageSections(), TrialLog(), NoLayouts()).follow(
        [['/a/oracle/events', OracleEvent._type]]
    )
    topics = robot_topics.RobotTopics('/more', OracleEvent, lambda robot: print, queue_size=5)
    topics.follow(['/a'])
    assert wait_for(lambda: '/a/more' in [each.topic for each in FakeSubscriber.made])
    topics.stop()
    assert len(FakeSubscriber.made) == 7
    assert {each.buff_size for each in FakeSubscriber.made} == {robot_topics.READ_BYTES}
