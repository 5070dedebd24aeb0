"""One step of one contact, numbers in and numbers out.

The same lines serve a ball against a wall, one at a time, and balls against balls, many at once:
hence no branch on what a contact does, no array, and no literal number, which would turn single
precision into double. See `castblast.muckpile.balls.contact` for the law and its sources.
"""

from __future__ import annotations

from math import sqrt

from castblast.kernel import fused_kernel, inline_kernel
from castblast.muckpile.balls.columns import (
    DASHPOT,
    ROLL_X,
    ROLL_Y,
    ROLL_Z,
    ROLLING_SLIP,
    SHEAR_X,
    SHEAR_Y,
    SHEAR_Z,
    SLIP,
    STIFFNESS,
    X,
    Y,
    Z,
)
from castblast.muckpile.balls.contact import Constants, Vector
from castblast.types import FloatArray, RealArray


@fused_kernel
def follow(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, angle: float, tiny: float
) -> Vector:
    """Carry a tangential vector into the plane of the normal and turn it by a small `angle`."""
    square = x * x + y * y + z * z
    along = x * nx + y * ny + z * nz
    ax, ay, az = x - along * nx, y - along * ny, z - along * nz
    tx = ax + angle * (ny * az - nz * ay)
    ty = ay + angle * (nz * ax - nx * az)
    tz = az + angle * (nx * ay - ny * ax)
    # Nothing stays nothing.
    scale = sqrt(square / max(tx * tx + ty * ty + tz * tz, tiny))
    return tx * scale, ty * scale, tz * scale


@fused_kernel
def grow(
    x: float,
    y: float,
    z: float,
    rx: float,
    ry: float,
    rz: float,
    grown: float,
    limit: float,
    drag: float,
    law: Constants,
) -> tuple[float, float, float, float, float]:
    """Let a spring force grow by `grown` times a rate, up to `limit`.

    With a `drag` the limit holds for the sum of the spring and a dashpot -drag rate. Returns the
    force of the spring, its share that is left (below 1: it slips), and its length before [N].
    """
    gx, gy, gz = x - grown * rx, y - grown * ry, z - grown * rz
    length = sqrt(gx * gx + gy * gy + gz * gz)
    cut = min(law.one, limit / max(length, law.tiny))
    return cut * gx + drag * rx, cut * gy + drag * ry, cut * gz + drag * rz, cut, length


@fused_kernel
def step_contact(
    law: Constants,
    friction: float,
    rolling_friction: float,
    nx: float,
    ny: float,
    nz: float,
    overlap: float,
    effective: float,
    sx: float,
    sy: float,
    sz: float,
    rx: float,
    ry: float,
    rz: float,
    angle: float,
    step: float,
    fx: float,
    fy: float,
    fz: float,
    mx: float,
    my: float,
    mz: float,
    kn: float,
    damping: float,
) -> tuple[Vector, Vector, Vector, Vector, Vector, Vector, float, float, float, float]:
    """Advance a contact by a step.

    Parameters
    ----------
    law : Constants
    friction, rolling_friction : float [-]
        Of this contact (walls may have their own).
    nx, ny, nz : float
        Unit vector from the first to the second partner.
    overlap : float [m]
        Positive.
    effective : float [m]
        Rbar = R1 R2/(R1 + R2); R against a wall.
    sx, sy, sz : float [m s-1]
        Velocity of the second relative to the first at the contact point.
    rx, ry, rz : float [rad s-1]
        Spin of the second relative to the first.
    angle : float [rad]
        Mean spin of both about the normal times the step: turns the plane with its partners.
    step : float [s]
    fx, fy, fz, mx, my, mz : float [N, N m]
        Shear force and rolling moment so far.
    kn, damping : float [N m-1, kg s-1]
        Stiffness and 2 sqrt(m_c k_n).

    Returns
    -------
    force : 3 floats [N]
        On the second partner.
    shear, moment : 3 floats [N, N m]
        The new memory; the moment is also what acts on the second partner.
    dash : 3 floats [N]
        Share of the dashpots in the force.
    turned, bent : 3 floats [N, N m]
        The memory as carried into the new contact plane.
    cut, length, roll_cut, roll_length : float
        Share left by slip and length before, of shear force [N] and moment [N m].

    Notes
    -----
    The shear force is carried into the new contact plane without change of length, then grows by
    -k_s du_s and is cut back to mu F_n, F_n being the force of the spring alone. The moment does
    the same with the bending part of the relative rotation.
    """
    ks, fn = kn * law.shear_ratio, kn * overlap
    vn = sx * nx + sy * ny + sz * nz
    vx, vy, vz = sx - vn * nx, sy - vn * ny, sz - vn * nz
    # vn < 0 while the partners approach.
    push = -law.damping_normal * damping * vn
    push = max(push, -fn) if law.no_tension else push
    drag = law.damping_shear * damping
    grip = max(fn + push, law.zero) if law.cap_on_total else fn
    hidden = drag if law.cap_on_total else law.zero

    turned = follow(fx, fy, fz, nx, ny, nz, angle, law.tiny)
    ax, ay, az, cut, length = grow(
        turned[0],
        turned[1],
        turned[2],
        vx,
        vy,
        vz,
        ks * step + hidden,
        friction * grip,
        hidden,
        law,
    )
    # At the limit is slipping: a frictionless contact slips before its spring has grown, and one
    # that slipped still does where a state is looked at anew (a firing), whatever was rounded.
    rests = law.slip_cut and not law.cap_on_total
    drag = (drag if length < law.almost * friction * grip else law.zero) if rests else drag

    wn = rx * nx + ry * ny + rz * nz
    kr = ks * effective * effective
    limit = rolling_friction * effective * grip
    bent = follow(mx, my, mz, nx, ny, nz, angle, law.tiny)
    bx, by, bz, roll_cut, roll_length = grow(
        bent[0], bent[1], bent[2], rx - wn * nx, ry - wn * ny, rz - wn * nz,
        kr * step, limit, law.zero, law,
    )  # fmt: skip
    dx, dy, dz = push * nx - drag * vx, push * ny - drag * vy, push * nz - drag * vz
    force = (fn * nx + ax + dx, fn * ny + ay + dy, fn * nz + az + dz)
    return (
        force, (ax, ay, az), (bx, by, bz), (dx, dy, dz),
        turned, bent, cut, length, roll_cut, roll_length,
    )  # fmt: skip


@inline_kernel
def book_step(
    work: FloatArray,
    w: int,
    dash: RealArray,
    p: int,
    law: Constants,
    effective: float,
    kn: float,
    step: float,
    normal: Vector,
    slide: Vector,
    shear: Vector,
    moment: Vector,
    dashpot: Vector,
    turned: Vector,
    bent: Vector,
    cut: float,
    length: float,
    roll_cut: float,
    roll_length: float,
) -> None:
    """Book in row `w` of `work` [J] what slip, rolling slip and dashpots of contact `p` took.

    Arguments as of `step_contact`. The dashpots work with half of their force before and half of
    their force now, over the same path: the form in which kick-drift-kick integration exchanges
    energy.
    """
    ks = kn * law.shear_ratio
    held = shear
    if law.cap_on_total:
        # The limit held for the spring and the shear dashpot together.
        along = dashpot[0] * normal[0] + dashpot[1] * normal[1] + dashpot[2] * normal[2]
        held = (
            shear[0] + dashpot[0] - along * normal[0],
            shear[1] + dashpot[1] - along * normal[1],
            shear[2] + dashpot[2] - along * normal[2],
        )
    work[w, SLIP] += _slip_work(turned, held, cut, length, ks)
    work[w, ROLLING_SLIP] += _slip_work(
        bent, moment, roll_cut, roll_length, ks * effective * effective
    )
    book_dashpot(work, w, dash, p, step, slide, dashpot)
    for axis in range(3):
        dash[p, axis] = dashpot[axis]


@inline_kernel
def book_dashpot(
    work: FloatArray, w: int, dash: RealArray, p: int, step: float, slide: Vector, now: Vector
) -> None:
    """Book the work of the dashpots of contact `p`, whose force is `now` [N]."""
    before = dash[p, X] * slide[0] + dash[p, Y] * slide[1] + dash[p, Z] * slide[2]
    after = now[0] * slide[0] + now[1] * slide[1] + now[2] * slide[2]
    work[w, DASHPOT] -= 0.5 * step * (before + after)


@inline_kernel
def book_opening(
    work: FloatArray,
    w: int,
    memory: RealArray,
    dash: RealArray,
    p: int,
    shear_ratio: float,
    effective: float,
    slide: Vector,
    step: float,
) -> None:
    """Close the books of a contact that has just opened.

    The springs hold almost nothing then, because their limits fell to zero with the normal force;
    what the last step left in them counts as slip.
    """
    ks = memory[p, STIFFNESS] * shear_ratio
    work[w, SLIP] += (
        memory[p, SHEAR_X] ** 2 + memory[p, SHEAR_Y] ** 2 + memory[p, SHEAR_Z] ** 2
    ) / (2.0 * ks)
    work[w, ROLLING_SLIP] += (
        memory[p, ROLL_X] ** 2 + memory[p, ROLL_Y] ** 2 + memory[p, ROLL_Z] ** 2
    ) / (2.0 * ks * effective * effective)
    book_dashpot(work, w, dash, p, step, slide, (0.0, 0.0, 0.0))


@inline_kernel
def _slip_work(before: Vector, left: Vector, cut: float, length: float, stiffness: float) -> float:
    """Work [J] of a slip: mean of the force before and after, times the path not taken up."""
    if cut >= 1.0 or length == 0.0:
        return 0.0
    mean = before[0] * left[0] + before[1] * left[1] + before[2] * left[2]
    limit = cut * length
    mean = 0.5 * (mean / limit + limit) if limit > 0.0 else 0.0
    return mean * (length - limit) / stiffness
