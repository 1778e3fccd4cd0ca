"""The ports of one robot's plug-ins, joined with its driver when that is made."""

from __future__ import annotations

from collections.abc import Callable

from nena_edge_agent.actions.drive import ActionDrive
from nena_edge_agent.actions.load_sensor import LoadSensor
from nena_edge_agent.actions.ports import RosPort
from nena_edge_agent.actions.settings import ActionSettings
from nena_edge_agent.driver.port import Driver, Pose
from nena_edge_agent.protocol.events import Event

Put = Callable[[Event], None]
DriverMaker = Callable[[Put, Pose | None], Driver]


class RobotPorts:
    """What plug-ins may use of a robot; ``ros`` is None where it has none.

    Raises:
        ConfigurationError: the load sensor's message is none of its type.

    """

    def __init__(self, ros: RosPort | None, settings: ActionSettings) -> None:
        self.ros = ros
        self.drive = ActionDrive()
        sensed = settings.load_sensor if ros else None
        self._sensor = LoadSensor(sensed, ros) if sensed and ros else None

    def joined(self, make_driver: DriverMaker) -> DriverMaker:
        """Give a maker of drivers that are looked at on the way to the core."""

        def make(put: Put, last_place: Pose | None) -> Driver:
            def heard(event: Event) -> None:
                self.drive.hear(event)
                put(event)

            if self._sensor:
                self._sensor.tell = put
            driver = make_driver(heard, last_place)
            self.drive.attach(driver)
            return driver

        return make
