"""Sensors as the server sends them, robots in 3D, and what interfaces show."""

from typing import List, Literal, Optional, Tuple, TypedDict

from .basics import ByKey, DriveFrame, EventName, SensorKind, Size, Vector

Colour = Tuple[float, float, float]  # red, green, blue
# name, position, velocity, effort; None: it was not measured
JointRow = Tuple[str, Optional[float], Optional[float], Optional[float]]
# link, geometry, pose (3 x 4, by rows), colour
LinkPart = Tuple[int, int, List[float], Colour]


class SensorView(TypedDict):
    """A sensor that can be watched."""

    id: int
    topic: str
    kind: SensorKind
    type: str


class PerceptionSensorsView(TypedDict):
    """Numbers of the sensors of a perception interface; None: there is none yet."""

    image: Optional[int]
    cloud: Optional[int]


class SensorListView(TypedDict):
    """All sensors, and those of the perception interfaces that run."""

    sensors: List[SensorView]
    perception: ByKey[PerceptionSensorsView]


class SensorFactsView(TypedDict):
    """GET /sample/NUMBER: what is told beside the newest message of a sensor."""

    sequence: int


class _StampedBase(SensorFactsView):
    frame: str  # of its coordinates
    stamp: str  # seconds.nanoseconds


class StampedFactsView(_StampedBase, total=False):
    """Facts of a message with a header."""

    age: Optional[float]  # s, by the robot's clock; None: not known


class _ImageBase(StampedFactsView):
    kind: Literal['colour', 'depth']
    size: Size  # of the original


class ImageFactsView(_ImageBase, total=False):
    """Facts of an image."""

    range: Tuple[float, float]  # nearest and furthest of a depth image


class CloudSizeView(TypedDict):
    """The points of a cloud, and where they are."""

    kind: Literal['cloud']
    count: int
    of: int  # points that there are
    offset: Vector  # positions are 16 bit shares of the scale, from the offset on
    scale: Vector


class _CloudBase(StampedFactsView, CloudSizeView):
    pass


class CloudFactsView(_CloudBase, total=False):
    """Facts of a cloud."""

    place: List[float]  # 3 x 4, by rows: at the robot that was asked for
    astray: str  # why that is not known


class JointFactsView(StampedFactsView):
    """The joints of a robot."""

    kind: Literal['joints']
    joints: List[JointRow]


class RobotFactsView(SensorFactsView):
    """Facts of a robot in 3D."""

    kind: Literal['robot']
    model: str  # version
    root: str  # link
    joints: int  # that are known


class GeometryView(TypedDict):
    """A mesh, whose corners are 16 bit shares of the scale, from the offset on."""

    corners: int
    triangles: int
    offset: Vector
    scale: Vector


class ModelHeaderView(TypedDict):
    """GET /model/NUMBER begins with this: what a robot looks like."""

    name: str
    version: str
    root: str
    links: List[str]
    geometries: List[GeometryView]
    missing: List[str]
    lost: int
    parts: List[LinkPart]


class MarkedCloudView(CloudSizeView):
    """The cloud of a marked object."""

    data: str  # its bytes, in base64


class MarkedObjectView(TypedDict):
    """An object that a perception interface has made out."""

    frame: str
    position: Vector
    yaw: float  # rad
    points: int
    size: Vector
    cloud: MarkedCloudView


class _MarkedBase(TypedDict):
    outlines: List[List[int]]  # x, y, x, y, ... px of each line around the mask
    elapsed: float  # s


class MarkedView(_MarkedBase, total=False):
    """What a perception interface has made out."""

    object: MarkedObjectView


class HandStateView(TypedDict):
    """The hand that is driven."""

    arm: str
    moving: bool
    limit: str  # what slows it
    refused: str
    share: Optional[float]  # of the commanded speed
    speed: Optional[float]  # m/s
    clearance: Optional[float]
    gripper: Optional[float]  # m between the fingers
    stalled: bool
    at: Tuple[Optional[float], Optional[float], Optional[float]]  # the tool: x, y, z


class _ManipulationBase(TypedDict):
    frames: List[DriveFrame]
    arms: List[str]
    boxes: Optional[int]  # in the robot's collision map; None: there is none
    wheel: Optional[int]  # which page drives
    driver: str


class ManipulationView(_ManipulationBase, total=False):
    """A manipulation interface that runs for a question."""

    state: HandStateView


class ReplayEventView(TypedDict):
    """An event of a replay."""

    t: float  # s after the failure, below 0 before it
    kind: EventName
    words: str


class JointCurveView(TypedDict):
    """A joint that moved."""

    name: str
    samples: List[Tuple[float, float]]  # s after the failure, and the position


class ReplayView(TypedDict):
    """GET /replay/NUMBER: the last seconds before a failure."""

    seconds: float  # how long before the failure it may begin
    cameras: List[str]  # topics
    frames: List[Tuple[int, float]]  # camera, and s after the failure
    events: List[ReplayEventView]
    joints: List[JointCurveView]  # those that moved most
