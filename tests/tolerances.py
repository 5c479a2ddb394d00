"""How far two answers may differ, in one place."""

KERNEL = 1e-9  # a fast function against its slow twin: rounding in float64, nothing else
CLOUD_RANGE = 1e-3  # [m] a point of a cloud, which is float32 and turned twice, against where it was made
RANGE = 4e-6  # [m] a float32 range of up to 30 m, and where a beam grazes a disc

MIRROR = 1e-3  # [m, rad] after seconds of driving in a mirrored world: scans are float32
MIRROR_ON_CELLS = 0.25  # [m], [rad] the same along a path on cells, which does not mirror exactly

FLOAT32_LAYER = 1e-5  # of sums of a hundred products near 1 in float32
NETWORK = 1e-4  # actions of eight such layers
DEEP_NETWORK = 2e-5  # actions of twenty convolutions of up to 2,304 products, with norms, in float32
# sim=skid. ODE: rms over random commands with the same start; the planar body has no pitch, roll or soft contacts.
ODE_SPEED = 0.02  # [m/s]
ODE_TURN_RATE = 0.08  # [rad/s]
ODE_POSITION = 0.01  # [m] after a second
# Gazebo: single runs with an unknown phase of the wheels, read to two digits.
GAZEBO_ACCELERATION = 0.15  # [-] relative
GAZEBO_GAIN = 0.03  # [-] steady turn rate per commanded one
GAZEBO_TURN_RATE = 0.1  # [rad/s]
GAZEBO_SIDESLIP = 0.2  # [m/s]
SWEEPS = 0.02  # [m, m/s, rad/s] two sweeps over the contacts against twenty, or in mirrored order
LIVE_TIME = (
    0.15  # [-] relative: median time of a few worlds over ROS, with messages under way, against lme eval
)

# Times from cell to cell against straight lines: the first-order scheme has its error near the target and at corners.
ARRIVAL_SHARE = 0.07  # [-] relative
ARRIVAL_CELLS = 3.0  # times for a cell
MIRROR_TURN = 0.3  # [rad] of the fall of such times
MIRROR_TIME = 1.0  # [s] expected times of a robot with 0.5 m/s on cells of 15 cm, which do not mirror
