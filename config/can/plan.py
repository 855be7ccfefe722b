"""Who owns which block of 32 CAN identifiers, by node number; lower identifiers win the bus.

Block 0 holds the e-stop and system frames, so no drive may be node 0; 63 is ODrive's broadcast.
"""

IDS_PER_NODE = 32
STEERING_ENCODER_NODE = 3
BEARING_SENSOR_NODES = (9, 10, 11)
