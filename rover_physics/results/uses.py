# SPDX-License-Identifier: Apache-2.0
"""Uses of the limits by results: 0 far away, 1 at the limit, above 1 broken.

The use is infinite where the rover does not settle or a value cannot be computed, and NaN where
the limit is not asked. A row passes if no use is above 1; nothing else compares a value with a
limit.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from rover_physics.limits import table
from rover_physics.limits.table import NOT_COMPUTABLE, TOLERANCE, Limit, Sense
from rover_physics.names import EQUAL, TORQUE_POLICIES
from rover_physics.numerics.arrays import Floats, freeze_fields, view_read_only
from rover_physics.numerics.kernels import exact_kernel
from rover_physics.numerics.records import new_record, record_type
from rover_physics.results.record import find_column, numbers_of
from rover_physics.rover.model import Rover
from rover_physics.status import PoseStatus

ABOVE = 1.0 + 2.0**-23
"""Least use of a broken limit, so that it is above 1 in single precision, too."""
MOST, LEAST, RANGE, SHARE = (int(sense) for sense in Sense)
FLAGS = ("needs_forces", "exempt_on_edge", "keeps_margin", "is_risk", "may_be_unknown")
"""Fields of a `Limit` that a LIMIT has, too."""

LIMIT = record_type(
    ("column", np.int64),  # first of the values in `numbers_of` a result
    ("count", np.int64),  # number of values
    ("sense", np.int64),  # a Sense
    ("least", float),  # smallest good value
    ("most", float),  # largest good value
    ("if_column", np.int64),  # column of the quantity that decides whether it is asked, or -1
    ("if_value", float),  # value of that quantity where it is asked
    *((flag, np.int64) for flag in FLAGS),
)
"""One row of the table with the bound of a rover, as kernels read it."""


@dataclass(frozen=True, eq=False)
class RoverLimits:
    """The limits of a rover that are asked under a policy, in the order of the table."""

    rows: tuple[Limit, ...]
    """Their rows in the table."""
    bounds: tuple[Any, ...]
    """Their bounds in SI units."""
    records: NDArray[Any]
    """(k,) LIMIT."""

    def __len__(self) -> int:
        return len(self.rows)

    def without_forces(self) -> "RoverLimits":
        """Return the limits that do not depend on the torques."""
        kept = [k for k, row in enumerate(self.rows) if not row.needs_forces]
        rows, bounds = (tuple(one[k] for k in kept) for one in (self.rows, self.bounds))
        return RoverLimits(rows, bounds, view_read_only(self.records[kept]))


def limits_of(rover: Rover, policy: str) -> RoverLimits:
    """Return the limits of a rover under a torque policy; those of equal torques for other words.

    A prediction from a file has the policy "recorded".
    """
    known = policy if policy in TORQUE_POLICIES else EQUAL
    return _pack_limits(SameObject(rover), known, table.LIMITS)


class SameObject:
    """A cache key that compares objects by identity, as hashing a rover takes long."""

    def __init__(self, value: Any):
        self.value = value

    def __hash__(self) -> int:
        return id(self.value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SameObject) and self.value is other.value


@lru_cache(maxsize=32)
def _pack_limits(same: SameObject, policy: str, rows: tuple[Limit, ...]) -> RoverLimits:
    found = [(row, row.find_bound(same.value)) for row in rows if policy in row.policies]
    asked = [(row, bound) for row, bound in found if bound is not None]
    records = np.array([_pack(row, bound) for row, bound in asked], LIMIT)
    bounds = tuple(bound for _, bound in asked)
    return RoverLimits(tuple(row for row, _ in asked), bounds, view_read_only(records))


def _pack(row: Limit, bound: Any) -> Any:
    column, count = find_column(row.reads)
    least, most = bound if row.sense == Sense.RANGE else (bound, bound)
    if_quantity, if_value = row.only_if or ("", 0.0)
    return new_record(
        LIMIT,
        column=column,
        count=count,
        sense=row.sense,
        least=least,
        most=most,
        if_column=find_column(if_quantity)[0] if if_quantity else -1,
        if_value=float(if_value),
        **{flag: getattr(row, flag) for flag in FLAGS},
    )


@dataclass(frozen=True, eq=False)
class Uses:
    """The uses of k limits at n results; arrays are read-only."""

    limits: RoverLimits
    """The limits."""
    use: Floats
    """(n, k) use of each limit."""
    element: NDArray[np.int64]
    """(n, k) index of the value that decides it, such as the wheel; -1 for none."""

    def __post_init__(self) -> None:
        freeze_fields(self)

    def find_first(self) -> NDArray[np.int64]:
        """Return the index (n,) of the first broken limit of each row, -1 if it passes."""
        broken = self.use > 1.0
        return np.where(broken.any(axis=1), broken.argmax(axis=1), -1)


def find_uses(limits: RoverLimits, results: Any) -> Uses:
    """Return the uses of limits at RESULTs (n,)."""
    shape = len(results), len(limits)
    use, element = np.empty(shape), np.empty(shape, np.int64)
    fill_uses(view_read_only(results), limits.records, use, element)
    return Uses(limits, use, element)


def find_codes(limits: RoverLimits, results: Any) -> list[str]:
    """Return the code of each of RESULTs (n,) that does not pass, "" of the others."""
    uses = find_uses(limits, results)
    first = uses.find_first()
    codes = np.array([*(row.code for row in limits.rows), ""], dtype=object)[first]
    rows = np.flatnonzero(first >= 0)
    columns = limits.records["column"][first[rows]] + uses.element[rows, first[rows]]
    codes[rows[np.isnan(numbers_of(results)[rows, columns])]] = NOT_COMPUTABLE
    for row in np.flatnonzero(results["status"] != PoseStatus.SETTLED):
        codes[row] = PoseStatus(results["status"][row]).name.lower()
    return list(codes)


@intrinsic
def number_at(_context: Any, result: Any, _column: Any) -> Any:
    """Return the number in a column of a RESULT, as `numbers_of` has it."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        kind = context.get_value_type(types.float64).as_pointer()
        return builder.load(builder.gep(builder.bitcast(arguments[0], kind), [arguments[1]]))

    return types.float64(result, types.int64), generate


@exact_kernel
def fill_uses(results, limits, use, element):
    """Write use and deciding element (n, k) of LIMITs (k,) at RESULTs (n,)."""
    for row in range(results.size):
        result = results[row]
        rolling_off_edge = is_rolling_off_edge(result)
        for k in range(limits.size):
            if result.status == PoseStatus.SETTLED:
                use[row, k], element[row, k] = find_use(result, limits[k], rolling_off_edge)
            else:
                use[row, k], element[row, k] = np.inf, -1


@exact_kernel
def is_rolling_off_edge(result):
    """Return whether a wheel rolls off an edge."""
    rolling_off_edge = False
    for wheel in range(6):
        rolling_off_edge = rolling_off_edge or result.falling[wheel] > 0.0
    return rolling_off_edge


@exact_kernel
def find_use(result, limit, rolling_off_edge):
    """Return the use of a LIMIT at a settled RESULT, and the index of what decides it."""
    if rolling_off_edge and limit.exempt_on_edge:
        return np.nan, -1
    if limit.if_column >= 0 and number_at(result, limit.if_column) != limit.if_value:
        return np.nan, -1
    mean = 0.0
    if limit.sense == SHARE:
        for k in range(limit.count):
            mean += number_at(result, limit.column + k)
        mean = max(mean / limit.count, TOLERANCE)
    most = limit.most * result.kept_share if limit.keeps_margin else limit.most
    worst, decides = -1.0, -1
    for k in range(limit.count):
        value = number_at(result, limit.column + k)
        if value != value:
            return (np.nan if limit.may_be_unknown else np.inf), k
        use = _use_of(value, limit.least, most, mean, limit.sense)
        if use > worst:
            worst, decides = use, k
    return worst, decides


@exact_kernel
def _use_of(value, least, most, mean, sense):
    """Return the use of a limit by a value that is not NaN; see Sense."""
    if sense == MOST:
        keeps = value <= most + TOLERANCE
        use = value / most if most > 0.0 else 0.0
    elif sense == LEAST:
        keeps = value >= least - TOLERANCE
        use = least / value if value > 0.0 else np.inf if least > 0.0 else 0.0
    elif sense == RANGE:
        keeps = least - TOLERANCE <= value <= most + TOLERANCE
        use = 1.0 - 2.0 * min(value - least, most - value) / (most - least)
    else:
        keeps = value >= -TOLERANCE
        use = 1.0 - value / mean
    return max(min(use, 1.0), 0.0) if keeps else max(use, ABOVE)


@exact_kernel
def find_broken(result, limits):
    """Return the index of the first broken limit of a settled RESULT, -1 if it passes.

    Also return that of the first which would be broken if a wheel rolled off an edge, too.
    """
    first, in_any_case, rolling_off_edge = -1, -1, is_rolling_off_edge(result)
    for k in range(limits.size):
        if find_use(result, limits[k], rolling_off_edge)[0] > 1.0:
            if first < 0:
                first = k
            if in_any_case < 0 and not limits[k].exempt_on_edge:
                in_any_case = k
    return first, in_any_case


@exact_kernel
def find_risk(result, limits):
    """Return the largest use of the limits that count as risk at a settled RESULT."""
    risk, rolling_off_edge = 0.0, is_rolling_off_edge(result)
    for k in range(limits.size):
        if limits[k].is_risk:
            use = find_use(result, limits[k], rolling_off_edge)[0]
            if use > risk:
                risk = use
    return risk
