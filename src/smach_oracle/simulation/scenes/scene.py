"""The contents of a trial's world: plain data, drawn from the trial's seed."""

from typing import NamedTuple, Optional, Tuple

Vector = Tuple[float, float, float]


class ClosingHinge(NamedTuple):
    """A hinge that pulls a door towards 0, unless it stands open past its stop."""

    torque: float  # N m
    stop: float  # rad. From there on the door stays where it is left
    pace: float = 0.4  # rad/s: it is damped, and does not slam


class Body(NamedTuple):
    """A thing in the world, in whose frame its pose is.

    The floor is z = 0. The robot starts near the origin facing x.
    """

    name: str
    # 'box', 'cylinder', 'round' (between a ball and a cylinder), 'cup', 'bottle' or 'urdf'
    shape: str
    size: Vector  # m; cylinder: radius, radius, height; urdf: unused; others: full extents
    position: Vector  # m, of its centre (urdf: of its root)
    yaw: float = 0.0  # rad, as roll and pitch: about the fixed axes z, x and y, roll first
    roll: float = 0.0
    pitch: float = 0.0
    mass: float = 0.0  # kg. 0 means it cannot move
    friction: float = 0.8  # coefficient
    colour: Vector = (0.5, 0.5, 0.5)
    urdf: str = ''  # text of the model, for shape 'urdf'
    joints: Tuple[Tuple[str, float], ...] = ()  # urdf: where its joints start
    joint_friction: Tuple[Tuple[str, float], ...] = ()  # urdf: N or N m
    joint_closing: Tuple[Tuple[str, ClosingHinge], ...] = ()  # urdf: those that close by themselves


class CameraQuality(NamedTuple):
    """The quality of the head camera's images in this trial."""

    noise: float = 1.0  # depth noise, times that of a Kinect
    dropout: float = 0.005  # share of depth pixels lost at random
    brightness: float = 1.0  # of the light, 1 is a lit room
    colour_noise: float = 6.0  # sigma, of 255


class Near(NamedTuple):
    """A place that an event must be near to."""

    place: Vector  # m, in the world
    within: float  # m


class Disturbance(NamedTuple):
    """Something that happens to the world in the course of a trial."""

    kind: str  # which, of those that physics/disturbances.py knows
    # the event that sets it off, e.g. 'look_at' (first head motion), 'see:2' (second image),
    # 'drive:1'. Those that are not near to `near` are not counted
    after: str
    values: Tuple[Tuple[str, float], ...] = ()
    cause: str = ''  # kind of the cause that it belongs to
    near: Optional[Near] = None


LOCALISATION = 'localisation'  # of what a cause ends by: where the robot believes to stand


class SceneCause(NamedTuple):
    """A reason to fail that this world was given, for the analysis afterwards."""

    kind: str  # short and stable, e.g. 'crowded', 'arm_in_view', 'sensor_noise', 'slippery_object'
    text: str  # in words, with figures
    # names of bodies, 'arm:' and a joint's name, LOCALISATION: it lasts until one of them is moved;
    # (): it ends with what its disturbance does, and without a disturbance never
    until: Tuple[str, ...] = ()
    # whether it is meant to be there still at a second try, and after the script was started over
    lasting: bool = False


class RobotStart(NamedTuple):
    """The robot at the beginning. Joints that are not named have their defaults."""

    joints: Tuple[Tuple[str, float], ...] = ()
    base: Vector = (0.0, 0.0, 0.0)  # x, y in m, yaw in rad, in the world
    # sigma of x, y, yaw that each drive adds between truth and odometry
    drive_error: Vector = (0.0, 0.0, 0.0)
    # x, y, yaw of the world in odom_combined: by so much the robot's localisation is wrong, until
    # it is told better
    localisation_error: Vector = (0.0, 0.0, 0.0)
    encoder_errors: Tuple[Tuple[str, float], ...] = ()  # rad that joints read too much
    # m and rad (roll, pitch, yaw) of the head camera, from where the URDF has it, in its own frame
    camera_error: Tuple[float, float, float, float, float, float] = (0.0,) * 6
    tip_wear: float = 0.0  # share of their friction that the finger tips have lost
    # x, y (m) and yaw (rad) that a long drive ends beside its goal each time, in its own axes: the
    # odometry does not see it
    drive_bias: Vector = (0.0, 0.0, 0.0)


class Goal(NamedTuple):
    """The conditions of a true success. The judge alone reads them."""

    kind: str  # 'stands_at' or 'in_hand'
    body: str  # name of the body; '' : any of the movable ones
    position: Vector = (0.0, 0.0, 0.0)  # stands_at: m, of its centre, in the world
    tolerance: float = 0.06  # m, horizontally


class Scene(NamedTuple):
    """A trial's world."""

    task: str
    seed: int
    bodies: Tuple[Body, ...]
    goal: Goal
    robot: RobotStart = RobotStart()
    camera: CameraQuality = CameraQuality()
    disturbances: Tuple[Disturbance, ...] = ()
    causes: Tuple[SceneCause, ...] = ()
