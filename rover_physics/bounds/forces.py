# SPDX-License-Identifier: Apache-2.0
"""Bounds on forces and tip-over angles over all possible configurations and contacts of a rover.

The forces depend on 18 inputs: the height of each wheel, and angle and place of each contact. Each
input has an interval. The equilibrium is solved with each input alone at either end; these gains
give the point at which an output is extreme, and the equilibrium is solved again there. Heights
and places take their worst ends together, whatever their correlation. Angle errors of different
wheels count as independent: the angles take the point of equal deviation at which the linear
change is largest.

Source for the angles: Hasofer and Lind, "Exact and invariant second-moment code format", Journal
of the Engineering Mechanics Division 100(1), 1974.
"""

import numpy as np

from rover_physics.contact.contact_record import point_of_rim, write_point
from rover_physics.forces.equilibrium import FREE_FORCES, balance_forces
from rover_physics.forces.shares import has_turned_wheels
from rover_physics.forces.soil import SoilWheel, solve_wheel
from rover_physics.forces.soil_sharing import rolling_direction
from rover_physics.forces.stability import CORNERS, measure_edge
from rover_physics.forces.torques import apply_torques, minimise_friction
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.prediction.evaluation import find_tip_over
from rover_physics.rover.linkage import place, place_masses
from rover_physics.status import TorquePolicy
from rover_physics.terrain.ground import SOIL_NUMBERS, copy_soil, friction_at, soil_row_at

HEIGHT_INPUTS, ANGLE_INPUTS, PLACE_INPUTS = 0, 6, 12
"""First index of wheel heights [m], contact angles [rad] and contact places along the axle [m]
among the inputs."""
INPUT_COUNT = 18
"""Number of inputs."""
LOAD_OUTPUTS, PULL_OUTPUTS, SIDE_OUTPUTS, USE_OUTPUTS, TIP_OUTPUTS = 0, 6, 12, 18, 24
"""First index of loads, tractions, lateral forces (over the rover's weight), utilisations and
tip-over angles [rad] among the outputs."""
OUTPUT_COUNT = 24 + CORNERS
"""Number of outputs."""
MIN_LOAD_SHARE = 1e-6
"""Least load [rover weights] in a utilisation, because the load is a divisor."""
TOGETHER = 2.0
"""Sum of the squares of the contact angles' deviations, each relative to its end. Errors of
different wheels count as independent, so all angles at their ends at once are too improbable."""
MAX_SOILS = 32
"""Largest number of soils on a map, the default included."""

BOX = record_type(
    ("base", float, (INPUT_COUNT,)),  # the nominal inputs
    ("ends", float, (2, INPUT_COUNT)),  # smallest and largest inputs
    ("at", float, (INPUT_COUNT,)),  # a point of the box
    ("value", float, (OUTPUT_COUNT,)),  # the outputs at that point
    ("base_value", float, (OUTPUT_COUNT,)),  # the nominal outputs
    ("gains", float, (2, INPUT_COUNT, OUTPUT_COUNT)),  # output changes, one input at either end
    ("smallest", float, (OUTPUT_COUNT,)),  # smallest outputs
    ("largest", float, (OUTPUT_COUNT,)),  # largest outputs
    # largest tractions and utilisations before any utilisation is bounded: the order of wheels
    # must not count
    ("pull", float, (6,)),
    ("level", float, (6,)),
    ("mu_low", float, (6,)),  # smallest friction coefficient of ground that a wheel may touch
    ("mu_high", float, (6,)),  # largest friction coefficient of that ground
    ("soils", np.int64, (6, MAX_SOILS)),  # rows of the soils that a wheel may touch
    ("soil_count", np.int64, (6,)),  # number of these soils
    ("soil", float, (SOIL_NUMBERS,)),  # one of these soils
    ("aim", float, (OUTPUT_COUNT,)),  # weights of the outputs in the sum that is maximised
    ("gain", float, (INPUT_COUNT,)),  # change of that sum with one input at its better end
    ("end", float, (INPUT_COUNT,)),  # the better end of each input
    ("columns", np.int64),  # columns of the balance that the torque policy needs
)
"""Box of the inputs, and bounds on the outputs over it; forces over the rover's weight."""


@kernel
def bound_forces(model, work):
    """Write smallest and largest outputs into `work.box`; False if the balance is singular.

    Under policy optimal, the torque differences are the best ones of the nominal configuration,
    and the common traction balances the rest. The best torques of another configuration need no
    more friction than these. On soil, equal torques are used: the best ones need no more friction.

    Args:
        model: MODEL on the nominal ground.
        work: BOUNDS_WORK with `spread` and `contact_bounds`.
    """
    rover, box, settings = work.rover, work.box, model.settings
    _fill_box(work.spread, work.contact_bounds, box)
    place(model.linkage, rover.pose, work.spread.q, rover.placement)
    _find_grounds(model, work)
    equal = settings.policy == TorquePolicy.EQUAL or settings.on_soil
    box.columns = 1 if equal else 1 + FREE_FORCES
    if not _choose_torques(model, work):
        return False
    for output in range(OUTPUT_COUNT):
        box.base_value[output] = box.smallest[output] = box.largest[output] = box.value[output]
    if not _find_gains(model, work):
        return False
    turned = has_turned_wheels(rover.placement)
    for wheel in range(6):
        _bound_output(model, work, LOAD_OUTPUTS + wheel)
        if wheel == 0 or box.columns > 1 or turned:
            _bound_output(model, work, PULL_OUTPUTS + wheel)
        else:
            box.smallest[PULL_OUTPUTS + wheel] = box.smallest[PULL_OUTPUTS]
            box.largest[PULL_OUTPUTS + wheel] = box.largest[PULL_OUTPUTS]
    for wheel in range(6):
        pulls = box.smallest[PULL_OUTPUTS + wheel], box.largest[PULL_OUTPUTS + wheel]
        box.pull[wheel] = max(abs(pulls[0]), abs(pulls[1]))
        box.level[wheel] = box.largest[USE_OUTPUTS + wheel]
    for wheel in range(6):
        _bound_use(model, work, wheel)
    for edge in range(CORNERS):
        _bound_output(model, work, TIP_OUTPUTS + edge)
    return True


@kernel
def _fill_box(spread, contact_bounds, box):
    low, high = box.ends[0], box.ends[1]
    for wheel in range(6):
        height, angle, lateral = HEIGHT_INPUTS + wheel, ANGLE_INPUTS + wheel, PLACE_INPUTS + wheel
        box.base[height] = 0.0
        low[height], high[height] = spread.low[wheel], spread.high[wheel]
        box.base[angle] = contact_bounds.angle[wheel]
        low[angle] = contact_bounds.angle_low[wheel]
        high[angle] = contact_bounds.angle_high[wheel]
        box.base[lateral] = contact_bounds.lateral[wheel]
        low[lateral] = contact_bounds.lateral_low[wheel]
        high[lateral] = contact_bounds.lateral_high[wheel]


@kernel
def _find_grounds(model, work):
    """Write friction and soils of all cells that each wheel of the placed rover may touch."""
    ground, settings, box = model.ground, model.settings, work.box
    cell = 1.0 / ground.inverse_resolution
    layered = ground.friction != 0 or ground.soil != 0
    for wheel in range(6):
        left, right, near, far = _find_footprint(model, work, wheel)
        box.mu_low[wheel], box.mu_high[wheel] = np.inf, 0.0
        box.soil_count[wheel] = 0
        columns = int((right - left) / cell) + 2 if layered else 1
        rows = int((far - near) / cell) + 2 if layered else 1
        for i in range(rows):
            for j in range(columns):
                x, y = min(left + j * cell, right), min(near + i * cell, far)
                mu = friction_at(ground, x, y, settings.friction)
                box.mu_low[wheel] = min(box.mu_low[wheel], mu)
                box.mu_high[wheel] = max(box.mu_high[wheel], mu)
                _note_soil(soil_row_at(ground, x, y), wheel, box)


@kernel
def _find_footprint(model, work, wheel):
    """Return smallest and largest x and y [m] of the points of a wheel that may touch.

    The wheel itself moves forward or back with the configuration, and sideways about as far.
    """
    radius, placement, moved = model.samples.radius, work.rover.placement, work.spread.shift[wheel]
    contact_bounds = work.contact_bounds
    left = near = np.inf
    right = far = -np.inf
    for corner in range(4):
        angle, across = contact_bounds.angle_low[wheel], contact_bounds.lateral_low[wheel]
        if corner > 1:
            angle = contact_bounds.angle_high[wheel]
        if corner % 2 == 1:
            across = contact_bounds.lateral_high[wheel]
        turn = np.sin(angle), np.cos(angle)
        x, y, _ = point_of_rim(radius, placement, (wheel, across), turn)
        left, right, near, far = min(left, x), max(right, x), min(near, y), max(far, y)
    return left - moved, right + moved, near - moved, far + moved


@kernel
def _note_soil(row, wheel, box):
    for k in range(box.soil_count[wheel]):
        if box.soils[wheel, k] == row:
            return
    box.soils[wheel, box.soil_count[wheel]] = row
    box.soil_count[wheel] += 1


@kernel
def _choose_torques(model, work):
    """Solve the nominal balance and keep its torque differences; False if it is singular."""
    rover, box, linkage = work.rover, work.box, model.linkage
    for k in range(INPUT_COUNT):
        box.at[k] = box.base[k]
    rover.search.y[:] = 0.0
    rover.search.resistance[:] = 0.0
    if not _evaluate(model, work):
        return False
    if box.columns > 1:
        for wheel in range(6):
            rover.search.mu[wheel] = box.mu_low[wheel]
        minimise_friction(linkage, model.settings, rover.balance, rover.search)
        return _evaluate(model, work)
    return True


@kernel
def _evaluate(model, work):
    """Write the outputs at the inputs `box.at`; return False if the balance is singular."""
    linkage, rover, spread, box = model.linkage, work.rover, work.spread, work.box
    placement, search, q = rover.placement, rover.search, spread.trial
    for i in range(6):
        q[i] = spread.q[i]
        for wheel in range(6):
            q[i] += spread.response[i, wheel] * box.at[HEIGHT_INPUTS + wheel]
    place(linkage, rover.pose, q, placement)
    place_masses(linkage, q, placement)
    for wheel in range(6):
        turn = np.sin(box.at[ANGLE_INPUTS + wheel]), np.cos(box.at[ANGLE_INPUTS + wheel])
        write_point(linkage.radius, rover, wheel, turn, box.at[PLACE_INPUTS + wheel])
    if not balance_forces(linkage, placement, rover.contacts, box.columns, rover.balance):
        return False
    apply_torques(rover.balance, box.columns - 1, search)
    for wheel in range(6):
        N, T, S = search.wheel_loads[wheel], search.tangential[wheel], search.lateral[wheel]
        box.value[LOAD_OUTPUTS + wheel], box.value[PULL_OUTPUTS + wheel] = N, T
        box.value[SIDE_OUTPUTS + wheel] = S
        as_it_rolls = N, rolling_direction(rover, wheel) * T, S
        box.value[USE_OUTPUTS + wheel] = _worst_use(model, box, wheel, as_it_rolls)
    find_tip_over(linkage, rover)
    for edge in range(CORNERS):
        angle, measure = measure_edge(rover.corners, edge, rover.centre, rover.force, rover.moment)
        box.value[TIP_OUTPUTS + edge] = angle
    return True


@kernel
def _worst_use(model, box, wheel, forces):
    """Return the largest utilisation of a wheel on any ground, for N, T as it rolls, and S."""
    ground, linkage, settings = model.ground, model.linkage, model.settings
    N, T, S = forces
    N = max(N, MIN_LOAD_SHARE)
    if not settings.on_soil:
        return np.sqrt(T * T + S * S) / (box.mu_low[wheel] * N)
    weight = linkage.mass * linkage.gravity
    worst = 0.0
    for k in range(box.soil_count[wheel]):
        copy_soil(ground, box.soils[wheel, k], box.soil)
        own = SoilWheel(linkage.radius, linkage.width, box.mu_low[wheel])
        solved = solve_wheel(box.soil, own, weight * N, weight * T, weight * S)
        worst = max(worst, solved.utilisation)
    return worst


@kernel
def _find_gains(model, work):
    """Write the change by each input alone at either end; False if the balance is singular."""
    box = work.box
    for k in range(INPUT_COUNT):
        box.at[k] = box.base[k]
    for k in range(INPUT_COUNT):
        for end in range(2):
            box.at[k] = box.ends[end, k]
            box.gains[end, k, :] = 0.0
            if box.at[k] == box.base[k]:
                continue
            if not _evaluate(model, work):
                return False
            _include_values(box)
            for output in range(OUTPUT_COUNT):
                box.gains[end, k, output] = box.value[output] - box.base_value[output]
        box.at[k] = box.base[k]
    return True


@kernel
def _include_values(box):
    """Widen the bounds to the outputs in `box.value`."""
    for output in range(OUTPUT_COUNT):
        box.smallest[output] = min(box.smallest[output], box.value[output])
        box.largest[output] = max(box.largest[output], box.value[output])


@kernel
def _bound_output(model, work, output):
    """Evaluate where an output is largest and where it is smallest."""
    box = work.box
    for side in range(2):
        box.aim[:] = 0.0
        box.aim[output] = 1.0 - 2.0 * side
        _go_to_extreme(model, work)


@kernel
def _bound_use(model, work, wheel):
    """Evaluate where the utilisation of a wheel is largest.

    The utilisation sqrt(T^2 + S^2) / (mu N) is at least u if T cos(a) + S sin(a) - u mu N >= 0 for
    some direction a. These sums are smooth where T and S change sign. They are maximised first for
    each combination of signs, then for the direction and the level found.
    """
    box = work.box
    pull, level = box.pull[wheel], box.level[wheel]
    side = abs(box.base_value[SIDE_OUTPUTS + wheel])
    total = 0.0
    for k in range(INPUT_COUNT):
        output = SIDE_OUTPUTS + wheel
        gain = max(abs(box.gains[0, k, output]), abs(box.gains[1, k, output]))
        if not ANGLE_INPUTS <= k < PLACE_INPUTS:
            side += gain
        else:
            total += gain * gain
    side += np.sqrt(TOGETHER * total)
    length = np.hypot(pull, side)
    if length == 0.0:
        return
    best, best_pull, best_side = 0.0, pull, side
    for corner in range(5):
        if corner < 4:
            pull = abs(pull) if corner < 2 else -abs(pull)
            side = abs(side) if corner % 2 == 0 else -abs(side)
        else:
            pull, side, level = best_pull, best_side, max(level, best)
            length = np.hypot(pull, side)
        box.aim[:] = 0.0
        box.aim[PULL_OUTPUTS + wheel], box.aim[SIDE_OUTPUTS + wheel] = pull / length, side / length
        box.aim[LOAD_OUTPUTS + wheel] = -level * box.mu_low[wheel]
        _go_to_extreme(model, work)
        if box.value[USE_OUTPUTS + wheel] > best:
            best = box.value[USE_OUTPUTS + wheel]
            best_pull, best_side = box.value[PULL_OUTPUTS + wheel], box.value[SIDE_OUTPUTS + wheel]


@kernel
def _go_to_extreme(model, work):
    """Evaluate where, according to the gains, the sum of outputs weighted by `box.aim` peaks."""
    box = work.box
    total = 0.0
    for k in range(INPUT_COUNT):
        low, high = 0.0, 0.0
        for output in range(OUTPUT_COUNT):
            if box.aim[output] != 0.0:
                low += box.aim[output] * box.gains[0, k, output]
                high += box.aim[output] * box.gains[1, k, output]
        gain, end = low, box.ends[0, k]
        if high > low:
            gain, end = high, box.ends[1, k]
        box.at[k] = box.base[k]
        box.gain[k], box.end[k] = max(gain, 0.0), end
        if gain > 0.0 and not ANGLE_INPUTS <= k < PLACE_INPUTS:
            box.at[k] = end
        elif gain > 0.0:
            total += gain * gain
    _share_deviation(total, box)
    if _evaluate(model, work):
        _include_values(box)


@kernel
def _share_deviation(total, box):
    """Move the angles from their nominal values in proportion to their gains, up to their ends.

    `total` is the sum of the squares of their gains. The deviation that an angle at its end does
    not use is shared among the others.
    """
    left = TOGETHER
    for _ in range(6):
        capped = False
        for k in range(ANGLE_INPUTS, PLACE_INPUTS):
            gain = box.gain[k]
            if gain > 0.0 and gain * gain * left >= total:
                box.at[k] = box.end[k]
                box.gain[k] = 0.0
                total -= gain * gain
                left -= 1.0
                capped = True
                if left <= 0.0:
                    return
        if not capped:
            break
    for k in range(ANGLE_INPUTS, PLACE_INPUTS):
        if box.gain[k] > 0.0:
            share = box.gain[k] * np.sqrt(left / max(total, 1e-30))
            box.at[k] = box.base[k] + min(share, 1.0) * (box.end[k] - box.base[k])
