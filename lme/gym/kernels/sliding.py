"""Motion of many robots whose wheels slide on the floor."""

import math

import numpy as np
from numba import njit

from lme.geometry.skid import Chassis, WheelState, slide
from lme.gym.kernels.crowds import crowd_of, first_touch, move
from lme.gym.kernels.delays import has_gait, receive, remember, send, walk
from lme.gym.kernels.poses import relative
from lme.gym.kernels.steps import driven_until, settle


@njit(cache=True, error_model="numpy", nogil=True)
def slide_all(
    chosen,
    states,
    bodies,
    places,
    obstacles,
    commands,
    chassis,
    limits,
    factors,
    yaw_errors,
    wheels,
    starts,
    phases,
    queues,
    gaits,
    encoders,
    rules,
    crowds,
    walkers,
):
    """Drive the chosen robots (K,) as `SkidSimulator.step` does.

    chassis (N, 11), limits (N, 4): of the controllers; factors (N, 2): ground per metre of tread, left and right;
    yaw_errors (N, P, E) [rad] of P pieces of a period; wheels: `WheelState` of arrays of N rows. rules: control period
    and latency [s], index into `AXES`, number of pieces, rate of the scans [Hz], 0 for one at each step, and time
    between two contact checks [s]. crowds, walkers: as in `roll`.
    """
    period, latency, axes, pieces, scan_rate, check_time = rules
    duration = period / pieces
    count = math.ceil(duration / check_time - 1e-9)
    travel = np.empty((pieces * count, 3))
    for i in chosen:
        begin = states.times[i]
        send(queues, i, begin + latency, commands[i, 0], commands[i, 1])
        remember(encoders.commands[i], commands[i], bodies.limits[i], period)
        c = chassis[i]
        own = Chassis(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9], c[10])
        state = WheelState(
            wheels.body[i], wheels.wheels[i], wheels.acceleration[i], wheels.grip[i], wheels.odometry[i]
        )
        bounds = (limits[i, 0], limits[i, 1], limits[i, 2], limits[i, 3])
        if crowds is not None:
            crowd = crowd_of(crowds, walkers, i)
        num_driven, end, contact, arrived, error = 0, begin, False, False, 0.0
        for k in range(pieces):
            if crowds is not None:
                at = states.poses[i] if k == 0 else travel[num_driven - 1]
                move(crowd, (at[0], at[1], at[2]), bodies.reaches[i], duration)
            # The command that is active in the middle of the piece, which legs may follow.
            time = begin + k * duration
            receive(queues, i, time + duration / 2)
            v, omega = queues.arrived[i, 0], queues.arrived[i, 1]
            if has_gait(gaits):
                distance, angle = walk(gaits, i, v, omega, duration)
                v, omega = distance / duration, angle / duration
            errors = yaw_errors[i, k]
            grounds = (factors[i, 0], factors[i, 1])
            poses = slide(state, own, (v, omega), bounds, grounds, axes, errors, duration, count)
            error = errors[len(errors) - 1]
            # Cut the piece at contact or arrival, which end the episode.
            driven, contact, arrived = driven_until(i, poses, bodies, places, obstacles)
            if crowds is not None:
                touch = first_touch(crowd, poses[:driven], bodies.boxes[i])
                if touch >= 0:
                    driven, contact, arrived = touch + 1, True, False
            travel[k * count : k * count + driven] = poses[:driven]
            num_driven = k * count + driven
            end = time + duration * driven / count
            if contact or arrived:
                break
        settle(i, states, places, travel[:num_driven], end, contact, arrived)
        # What wheels and gyro measure, and where the newest scan was taken.
        pose = (states.poses[i, 0], states.poses[i, 1], states.poses[i, 2])
        measured = (state.odometry[0], state.odometry[1], pose[2] + error)
        start = (starts[i, 0], starts[i, 1], starts[i, 2])
        odometry = encoders.odometry[i]
        odometry[0], odometry[1], odometry[2] = relative(measured, start)
        encoders.twists[i, 0], encoders.twists[i, 1] = state.wheels[0], state.body[5]
        back = 0
        if scan_rate > 0.0:
            back = round((end + phases[i]) % (1.0 / scan_rate) / check_time)
        encoders.scans[i] = travel[max(num_driven - 1 - back, 0)]
