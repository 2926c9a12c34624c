"""PatchMatch stereo of one reference view: the compiled kernels.

A hypothesis for a pixel is a plane, held as the inverse depth w at the pixel's centre and its change g_u, g_v per
pixel. The inverse depth of a plane is affine in pixel coordinates, so a neighbour's plane is carried over exactly.
Into a source view the plane maps the patch by a homography, of which the kernels use the first-order (affine) part.

Pixel coordinates inside the kernels are indices: the centre of the upper left pixel is (0, 0).

Everything random is a hash of (key, pixel, step), and pixels of one colour of the checkerboard only read pixels of the
other, so the result depends on nothing but the arguments.

References: Bleyer et al., PatchMatch Stereo (BMVC 2011); Galliani et al., Massively Parallel Multiview Stereopsis
(ICCV 2015); Xu and Tao, Multi-Scale Geometric Consistency Guided MVS (CVPR 2019).
"""

# mypy: disable-error-code="no-untyped-def"
# (Numba infers the kernels' types.)

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float32, int32, uint32, uint64
from numpy.typing import NDArray

from fieldkit.arrays import BoolArray, Float32Array, IntArray
from fieldkit.runtime.kernels import fast_kernel, inline_fast_kernel

SAMPLES = 16
"""Samples of a patch."""
REACH = 3
"""Distance of the outermost samples from the centre, pixels along each axis."""
OFFSET_U = np.array([1, -1, 0, 0, 2, -2, 2, -2, 3, 3, -3, -3, 1, 1, -1, -1], dtype=np.float32)
OFFSET_V = np.array([0, 0, 1, -1, 2, 2, -2, -2, 1, -1, 1, -1, 3, -3, 3, -3], dtype=np.float32)
"""The samples: a quincunx (every other pixel, chequered) of radius 3 without its centre."""

HOPELESS = np.float32(0.05)
"""A neighbour that is this much dearer where it stands is not tried."""
UNSEEN = np.float32(1.2)
"""Cost of a source view that does not see the whole patch; above every accepted cost."""


class Active(NamedTuple):
    """The n pixels of a view to work on."""

    pixels: NDArray[np.int32]
    """(n, 2) int32 row, column; row by row."""
    place: NDArray[np.int32]
    """(H, W) int32 place in ``pixels`` or −1."""
    ranges: Float32Array
    """(n, 2) float32 smallest and largest inverse depth to search, 1/m."""
    leaving: Float32Array
    """(n,) float32 inverse depth at which the ray leaves the volume, 1/m."""

    def inside(self, inverse_depths: Float32Array) -> BoolArray:
        """Which of n inverse depths, one per pixel, lie in the volume."""
        return np.asarray(inverse_depths >= self.leaving, dtype=np.bool_)


class Planes(NamedTuple):
    """Plane hypotheses of a view's active pixels."""

    planes: Float32Array
    """(n, 3) float32 (w, g_u, g_v): inverse depth (1/m) and its change per pixel to the right and down. w is 0 where a
    pixel shows what lies behind the volume: it is left alone."""
    costs: Float32Array
    """(n,) float32."""


class Stereo(NamedTuple):
    """What a plane costs by the photographs alone: the reference view's patches and the k source views."""

    support: Float32Array
    """(n, 32) float32, see `support_weights`."""
    packed: NDArray[np.uint32]
    """The source views' pixels, one view after the other, see `pack_source`."""
    sizes: IntArray
    """(k, 3) int64 start in ``packed``, width, height."""
    cameras: Float32Array
    back: Float32Array
    """(k, 12) float32 into the source views and from them, see `relative_camera`."""
    lens: Float32Array
    """(4,) float32 f_x, f_y, c_x, c_y of the reference view, in index coordinates."""
    noise: np.float32
    """Variance of the grey levels that counts as no texture."""
    best: int
    slack: np.float32
    """Of the k costs the ``best`` (1 to 3) lowest are averaged, none counted more than ``slack`` above the lowest: such
    a view is taken not to see the surface."""


class Agreement(NamedTuple):
    """What a plane costs where it disagrees with the source views' own depths.

    Each view's cost grows by weight · min(distance in pixels by which a pixel misses itself when sent there and back,
    cap). A weight of 0 leaves it at the photographs alone, and ``depths`` unread.
    """

    depths: Float32Array
    """(k, rows, columns) float32 inverse depths, 1/m; 0: none."""
    weight: np.float32
    """Per pixel of distance."""
    cap: np.float32
    """Pixels."""


class Steps(NamedTuple):
    """How a sweep perturbs planes."""

    tries: int
    """Per pixel; each halves the range of the one before."""
    reach_w: np.float32
    """Range of the first try, as inverse depth (1/m)."""
    same_w: np.float32
    """Planes closer than this in inverse depth, and as close in slope, are not tried again (1/m)."""


_NEIGHBOR_U = np.array([-1, 1, 0, 0, -3, 3, 0, 0], dtype=np.int64)
_NEIGHBOR_V = np.array([0, 0, -1, 1, 0, 0, -3, 3], dtype=np.int64)


@fast_kernel
def _mix(x):
    """A well mixed uint64 of a uint64 (the finaliser of SplitMix64)."""
    x = (x ^ (x >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> uint64(27))) * uint64(0x94D049BB133111EB)
    return x ^ (x >> uint64(31))


@fast_kernel
def _uniform(state):
    """A float32 in [0, 1) of a mixed uint64."""
    return float32(int32(state >> uint64(40))) * float32(1.0 / 16777216.0)


@fast_kernel
def _sample_cost(stereo, k, p, x0, y0, a_x, a_y, b_x, b_y):
    """1 − weighted NCC of pixel ``p``'s patch with an affine patch of source view ``k``."""
    packed, support = stereo.packed, stereo.support
    base, stride = stereo.sizes[k, 0], stereo.sizes[k, 1]
    mean = float32(0.0)
    square = float32(0.0)
    product = float32(0.0)
    for i in range(SAMPLES):
        x = x0 + a_x * OFFSET_U[i] + b_x * OFFSET_V[i]
        y = y0 + a_y * OFFSET_U[i] + b_y * OFFSET_V[i]
        column = int32(x)
        row = int32(y)
        f_x = x - float32(column)
        f_y = y - float32(row)
        # Unsigned, or numba asks of every sample whether it counts from the end.
        four = packed[uint64(base + np.intp(row) * stride + np.intp(column))]
        p00 = float32(int32(four & uint32(255)))
        p01 = float32(int32((four >> uint32(8)) & uint32(255)))
        p10 = float32(int32((four >> uint32(16)) & uint32(255)))
        p11 = float32(int32(four >> uint32(24)))
        top = p00 + f_x * (p01 - p00)
        bottom = p10 + f_x * (p11 - p10)
        value = top + f_y * (bottom - top) - float32(128.0)
        weight = support[p, i]
        mean += weight * value
        square += weight * value * value
        product += support[p, SAMPLES + i] * value
    variance = max(square - mean * mean, float32(0.0)) + stereo.noise
    return float32(1.0) - product / np.sqrt(variance)


@inline_fast_kernel
def _cost(stereo, agreement, p, u, v, w, g_u, g_v, limit):
    """Cost of a plane at pixel ``p``, which is (u, v); where it is above ``limit``, anything above."""
    sizes, cameras, best, slack = stereo.sizes, stereo.cameras, stereo.best, stereo.slack
    first = float32(9.0)
    second = float32(9.0)
    third = float32(9.0)
    reach = float32(REACH)
    for k in range(sizes.shape[0]):
        cost = UNSEEN
        z = cameras[k, 6] * u + cameras[k, 7] * v + cameras[k, 8] + w * cameras[k, 11]
        if z > float32(1e-6):
            scale = float32(1.0) / z
            x0 = (cameras[k, 0] * u + cameras[k, 1] * v + cameras[k, 2] + w * cameras[k, 9]) * scale
            y0 = (cameras[k, 3] * u + cameras[k, 4] * v + cameras[k, 5] + w * cameras[k, 10]) * scale
            z_u = cameras[k, 6] + g_u * cameras[k, 11]
            z_v = cameras[k, 7] + g_v * cameras[k, 11]
            a_x = (cameras[k, 0] + g_u * cameras[k, 9] - x0 * z_u) * scale
            a_y = (cameras[k, 3] + g_u * cameras[k, 10] - y0 * z_u) * scale
            b_x = (cameras[k, 1] + g_v * cameras[k, 9] - x0 * z_v) * scale
            b_y = (cameras[k, 4] + g_v * cameras[k, 10] - y0 * z_v) * scale
            reach_x = reach * (abs(a_x) + abs(b_x))
            reach_y = reach * (abs(a_y) + abs(b_y))
            width = sizes[k, 1]
            height = sizes[k, 2]
            if (
                reach_x < float32(12.0)
                and reach_y < float32(12.0)
                and x0 >= reach_x
                and y0 >= reach_y
                and x0 + reach_x < float32(width - 1)
                and y0 + reach_y < float32(height - 1)
            ):
                cost = _sample_cost(stereo, k, p, x0, y0, a_x, a_y, b_x, b_y)
                if agreement.weight > float32(0.0):
                    cost += agreement.weight * _round_trip(stereo.back, agreement, k, u, v, x0, y0)
        # Kept in order without branches, which would be mispredicted half the time.
        worse = max(cost, first)
        first = min(cost, first)
        worst = max(worse, second)
        second = min(worse, second)
        third = min(worst, third)
        # One view is left: even if it cost nothing, the mean over two would be above the limit.
        if k == sizes.shape[0] - 2 and min(first, slack) > float32(2.0) * limit:
            return first
    if best == 1:
        return first
    if best == 2:
        return float32(0.5) * (first + min(second, first + slack))
    return (first + min(second, first + slack) + min(third, first + slack)) * float32(1.0 / 3.0)


@fast_kernel
def _round_trip(back, agreement, k, u, v, x0, y0):
    """Pixels by which (u, v) misses itself when sent to source view k and back by that view's own depth; ≤ cap."""
    cap = agreement.cap
    column = int32(x0 + float32(0.5))
    row = int32(y0 + float32(0.5))
    w = agreement.depths[k, row, column]
    if w <= float32(0.0):
        return cap
    x = float32(column)
    y = float32(row)
    z = back[k, 6] * x + back[k, 7] * y + back[k, 8] + w * back[k, 11]
    if z <= float32(1e-6):
        return cap
    d_u = (back[k, 0] * x + back[k, 1] * y + back[k, 2] + w * back[k, 9]) / z - u
    d_v = (back[k, 3] * x + back[k, 4] * y + back[k, 5] + w * back[k, 10]) / z - v
    return min(np.sqrt(d_u * d_u + d_v * d_v), cap)


@fast_kernel
def _tilt(state, u, v, w, lens, steepest):
    """Gradient (g_u, g_v) of a plane through (u, v, w) whose normal is random, at most ``steepest`` (a sine) oblique.

    ``lens`` = (f_x, f_y, c_x, c_y) of the reference view, in index coordinates.
    """
    r_x = (u - lens[2]) / lens[0]
    r_y = (v - lens[3]) / lens[1]
    # In a frame about the ray: the slope of the plane against the image plane is the tangent of its obliquity.
    angle = float32(6.2831853) * _uniform(state)
    sine = steepest * np.sqrt(_uniform(_mix(state + uint64(1))))
    cosine = np.sqrt(float32(1.0) - sine * sine)
    n_x = sine * np.cos(angle)
    n_y = sine * np.sin(angle)
    length = np.sqrt(r_x * r_x + r_y * r_y + float32(1.0))
    # Rotate (n_x, n_y, cosine) so that its third axis is the ray (the shortest rotation).
    d_x = r_x / length
    d_y = r_y / length
    d_z = float32(1.0) / length
    h = float32(1.0) / (float32(1.0) + d_z)
    m_x = (float32(1.0) - h * d_x * d_x) * n_x - h * d_x * d_y * n_y + d_x * cosine
    m_y = -h * d_x * d_y * n_x + (float32(1.0) - h * d_y * d_y) * n_y + d_y * cosine
    m_z = -d_x * n_x - d_y * n_y + d_z * cosine
    along = m_x * r_x + m_y * r_y + m_z
    return w * m_x / (lens[0] * along), w * m_y / (lens[1] * along)


@fast_kernel
def start(found, fresh, active, stereo, nothing, key, starts):
    """Give every pixel the best of ``starts`` random planes, one in each equal share of its inverse-depth range.

    Args:
        found: `Planes`, written; where ``fresh`` is False, a plane to be compared with.
        fresh: (n,) bool: whether the pixel has no plane yet.
        active: `Active`.
        stereo: `Stereo`.
        nothing: `Agreement` without weight.
        key: uint64 that everything random starts from.
        starts: how many.
    """
    planes, costs = found
    pixels, ranges = active.pixels, active.ranges
    steepest = float32(0.9)
    for p in range(pixels.shape[0]):
        v = float32(pixels[p, 0])
        u = float32(pixels[p, 1])
        low = ranges[p, 0]
        span = ranges[p, 1] - low
        seed = _mix(key ^ (uint64(pixels[p, 0]) << uint64(32)) ^ uint64(pixels[p, 1]))
        lowest = float32(9.0)
        if not fresh[p]:
            if planes[p, 0] <= float32(0.0):
                continue
            lowest = _cost(stereo, nothing, p, u, v, planes[p, 0], planes[p, 1], planes[p, 2], lowest)
        for i in range(starts):
            state = _mix(seed + uint64(i + 1) * uint64(0x9E3779B97F4A7C15))
            w = low + span * (float32(i) + _uniform(state)) / float32(starts)
            g_u, g_v = _tilt(_mix(state ^ uint64(0x5851F42D4C957F2D)), u, v, w, stereo.lens, steepest)
            cost = _cost(stereo, nothing, p, u, v, w, g_u, g_v, lowest)
            if cost < lowest:
                lowest = cost
                planes[p, 0] = w
                planes[p, 1] = g_u
                planes[p, 2] = g_v
        costs[p] = lowest


@fast_kernel
def sweep(found, active, stereo, agreement, steps, key, color, step):
    """One half sweep: pixels of one colour of the checkerboard take over better planes and perturb their own.

    Args:
        found, active, stereo, key: see `start`.
        agreement: `Agreement`.
        steps: `Steps`.
        color: 0 or 1, (row + column) mod 2 of the pixels to update.
        step: number of the sweep, part of the random state.
    """
    planes, costs = found
    pixels, index, ranges, same_w = active.pixels, active.place, active.ranges, steps.same_w
    rows, columns = index.shape
    tried = np.empty((9, 3), dtype=np.float32)
    for p in range(pixels.shape[0]):
        row = pixels[p, 0]
        column = pixels[p, 1]
        if (row + column) % 2 != color or planes[p, 0] <= float32(0.0):
            continue
        v = float32(row)
        u = float32(column)
        low = ranges[p, 0]
        high = ranges[p, 1]
        w = planes[p, 0]
        g_u = planes[p, 1]
        g_v = planes[p, 2]
        lowest = costs[p]
        tried[0, 0] = w
        tried[0, 1] = g_u
        tried[0, 2] = g_v
        count = 1
        for i in range(8):
            d_u = _NEIGHBOR_U[i]
            d_v = _NEIGHBOR_V[i]
            r = row + d_v
            c = column + d_u
            if r < 0 or c < 0 or r >= rows or c >= columns:
                continue
            q = index[r, c]
            if q < 0 or costs[q] > lowest + HOPELESS:
                continue
            n_u = planes[q, 1]
            n_v = planes[q, 2]
            n_w = planes[q, 0] - n_u * float32(d_u) - n_v * float32(d_v)
            if n_w < low or n_w > high:
                continue
            seen = False
            for j in range(count):
                if (
                    abs(tried[j, 0] - n_w) < same_w
                    and float32(REACH) * (abs(tried[j, 1] - n_u) + abs(tried[j, 2] - n_v)) < same_w
                ):
                    seen = True
                    break
            if seen:
                continue
            tried[count, 0] = n_w
            tried[count, 1] = n_u
            tried[count, 2] = n_v
            count += 1
            cost = _cost(stereo, agreement, p, u, v, n_w, n_u, n_v, lowest)
            if cost < lowest:
                lowest = cost
                w = n_w
                g_u = n_u
                g_v = n_v
        seed = _mix(key ^ (uint64(row) << uint64(32)) ^ uint64(column))
        seed = _mix(seed ^ (uint64(step + 1) * uint64(0xD6E8FEB86659FD93)))
        reach = steps.reach_w
        for i in range(steps.tries):
            state = _mix(seed + uint64(i + 1) * uint64(0x9E3779B97F4A7C15))
            n_w = w + reach * (float32(2.0) * _uniform(state) - float32(1.0))
            n_u = g_u
            n_v = g_v
            if i % 2 == 0:
                state = _mix(state + uint64(1))
                n_u = g_u + reach * float32(0.3) * (float32(2.0) * _uniform(state) - float32(1.0))
                state = _mix(state + uint64(1))
                n_v = g_v + reach * float32(0.3) * (float32(2.0) * _uniform(state) - float32(1.0))
            reach *= float32(0.5)
            if n_w < low or n_w > high:
                continue
            cost = _cost(stereo, agreement, p, u, v, n_w, n_u, n_v, lowest)
            if cost < lowest:
                lowest = cost
                w = n_w
                g_u = n_u
                g_v = n_v
        planes[p, 0] = w
        planes[p, 1] = g_u
        planes[p, 2] = g_v
        costs[p] = lowest


@fast_kernel
def carry(carried, active, source, found, lens_source, lens, rotation, offset, limit):
    """Planes of a source view as planes of the reference view, at the pixels its points fall on.

    Args:
        carried: (n, 3) float32, written: the nearest plane that falls on each pixel, or zeros.
        active: `Active` of the reference view.
        source, found: `Active` and `Planes` of the source view.
        lens_source, lens: (4,) float32 f_x, f_y, c_x, c_y of both, in index coordinates.
        rotation, offset: (3, 3), (3,) float32, X_source = rotation X + offset.
        limit: planes that cost as much or more are left out.
    """
    index, source_pixels = active.place, source.pixels
    source_planes, source_costs = found
    rows, columns = index.shape
    for p in range(carried.shape[0]):
        carried[p, 0] = float32(0.0)
    for s in range(source_pixels.shape[0]):
        w = source_planes[s, 0]
        if source_costs[s] >= limit or w <= float32(0.0):
            continue
        x = (float32(source_pixels[s, 1]) - lens_source[2]) / lens_source[0]
        y = (float32(source_pixels[s, 0]) - lens_source[3]) / lens_source[1]
        # The plane is normal · X = 1 in the source's frame.
        n_x = source_planes[s, 1] * lens_source[0]
        n_y = source_planes[s, 2] * lens_source[1]
        n_z = w - n_x * x - n_y * y
        p_x = x / w - offset[0]
        p_y = y / w - offset[1]
        p_z = float32(1.0) / w - offset[2]
        z = rotation[0, 2] * p_x + rotation[1, 2] * p_y + rotation[2, 2] * p_z
        if z <= float32(1e-6):
            continue
        u = (rotation[0, 0] * p_x + rotation[1, 0] * p_y + rotation[2, 0] * p_z) / z * lens[0] + lens[2]
        v = (rotation[0, 1] * p_x + rotation[1, 1] * p_y + rotation[2, 1] * p_z) / z * lens[1] + lens[3]
        if not (u > float32(-0.5) and v > float32(-0.5)):
            continue
        if u >= float32(columns) - float32(0.5) or v >= float32(rows) - float32(0.5):
            continue
        column = int32(u + float32(0.5))
        row = int32(v + float32(0.5))
        p = index[row, column]
        if p < 0:
            continue
        side = float32(1.0) - n_x * offset[0] - n_y * offset[1] - n_z * offset[2]
        if side <= float32(1e-6):
            continue
        g_u = (rotation[0, 0] * n_x + rotation[1, 0] * n_y + rotation[2, 0] * n_z) / side / lens[0]
        g_v = (rotation[0, 1] * n_x + rotation[1, 1] * n_y + rotation[2, 1] * n_z) / side / lens[1]
        here = float32(1.0) / z + g_u * (float32(column) - u) + g_v * (float32(row) - v)
        if here > carried[p, 0]:
            carried[p, 0] = here
            carried[p, 1] = g_u
            carried[p, 2] = g_v


@fast_kernel
def adopt(found, carried, active, stereo, agreement):
    """Take over the planes of ``carried`` (n, 3) that cost less; the other arguments are those of `sweep`."""
    planes, costs = found
    pixels, ranges = active.pixels, active.ranges
    for p in range(pixels.shape[0]):
        w, g_u, g_v = carried[p, 0], carried[p, 1], carried[p, 2]
        if planes[p, 0] <= float32(0.0) or w < ranges[p, 0] or w > ranges[p, 1]:
            continue
        cost = _cost(stereo, agreement, p, float32(pixels[p, 1]), float32(pixels[p, 0]), w, g_u, g_v, costs[p])
        if cost < costs[p]:
            costs[p] = cost
            planes[p, 0] = w
            planes[p, 1] = g_u
            planes[p, 2] = g_v


@fast_kernel
def score(found, active, stereo, agreement):
    """Write the costs of the planes of ``found``; the arguments are those of `sweep`."""
    planes, costs = found
    pixels = active.pixels
    for p in range(pixels.shape[0]):
        u, v = float32(pixels[p, 1]), float32(pixels[p, 0])
        if planes[p, 0] > float32(0.0):
            costs[p] = _cost(stereo, agreement, p, u, v, planes[p, 0], planes[p, 1], planes[p, 2], float32(9.0))
