"""Keys of properties that NeNa honours. Any other property is kept with its object and passed over."""

from typing import Final

PREFERRED_PARKING_POSITION: Final = "tcs:preferredParkingPosition"
ASSIGNED_PARKING_POSITION: Final = "tcs:assignedParkingPosition"
PARKING_POSITION_PRIORITY: Final = "tcs:parkingPositionPriority"
PREFERRED_RECHARGE_LOCATION: Final = "tcs:preferredRechargeLocation"
ASSIGNED_RECHARGE_LOCATION: Final = "tcs:assignedRechargeLocation"
ROUTING_GROUP: Final = "tcs:routingGroup"
ROUTING_COST_FORWARD: Final = "tcs:routingCostForward"
ROUTING_COST_REVERSE: Final = "tcs:routingCostReverse"
BLOCK_ENTRY_DIRECTION: Final = "tcs:blockEntryDirection"

VDA5050_INTERFACE_NAME: Final = "vda5050:interfaceName"
VDA5050_MANUFACTURER: Final = "vda5050:manufacturer"
VDA5050_SERIAL_NUMBER: Final = "vda5050:serialNumber"
VDA5050_VERSION: Final = "vda5050:version"
VDA5050_MAP_ID: Final = "vda5050:mapId"
VDA5050_DEVIATION_XY: Final = "vda5050:deviationXY"
VDA5050_DEVIATION_THETA: Final = "vda5050:deviationTheta"

VEHICLE_TYPE: Final = "nena:vehicleType"
"""Of a vehicle: the type by which LIF names those who may use a point or path, such as `ACME.T800`."""
ALLOWED_MAPS: Final = "nena:allowedMaps"
"""Of a vehicle: the ids of the maps on which it may drive, with commas between; without it, all."""
MAP_TRANSFORM: Final = "nena:mapTransform."
"""Of the model, before a map's id: how the plant lies on that map."""
