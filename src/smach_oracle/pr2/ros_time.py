"""The time that work takes in a simulated world, passed over ROS."""

import threading
from typing import Optional

import rosgraph
import rospy

from smach_oracle.srv import PassTime


class WorldTime:
    """Lets time pass in the world by its service. Where there is none, time passes by itself."""

    def __init__(self, service: str) -> None:
        """Connect to nothing yet.

        :param service: smach_oracle/PassTime. '' means none.
        """
        self._name = rospy.resolve_name(service) if service else ''
        self._proxy: Optional[rospy.ServiceProxy] = None  # while it is connected
        self._calling = threading.Lock()

    def spend(self, seconds: float, what: str) -> None:
        """Let so many s of the world's time pass, and return when they have.

        A world that is not there, or goes meanwhile, costs nothing: whatever is done next fails.

        :param what: as in PassTime.
        """
        if not self._name or seconds <= 0:
            return
        with self._calling:
            try:
                self._call(seconds, what)
            except (rospy.ServiceException, rospy.ROSException, OSError) as err:
                rospy.logwarn('%s: %s', self._name, err)

    def _call(self, seconds: float, what: str) -> None:
        """Ask over the connection of the last time, where that is still there."""
        if self._proxy is not None:
            try:
                self._proxy(seconds, what)
                return
            except (rospy.ServiceException, rospy.ROSException):
                self._proxy.close()  # the world has been started again, or is gone
                self._proxy = None
        if self._offered():
            self._proxy = rospy.ServiceProxy(self._name, PassTime, persistent=True)
            self._proxy(seconds, what)

    def _offered(self) -> bool:
        try:
            return bool(rosgraph.Master(rospy.get_name()).lookupService(self._name))
        except rosgraph.MasterException:
            return False
