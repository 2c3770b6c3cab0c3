"""NumPy's generator PCG64 on a device: the same numbers as on the processor, from the same seeds.

M. O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for Random
Number Generation" (2014): 128 bits of state, XSL-RR output. A leg's row is the state, its
increment, whether half of a draw is left, and that half.
"""
# Warp reads annotations as types of its own, and its operators are not Python's.
# pyright: reportInvalidTypeForm=false, reportMissingImports=false, reportArgumentType=false
# pyright: reportOperatorIssue=false, reportIndexIssue=false, reportReturnType=false
# pyright: reportAttributeAccessIssue=false, reportCallIssue=false
# pyright: reportAssignmentType=false, reportGeneralTypeIssues=false

import warp as wp

wp.set_module_options({"enable_backward": False})

LOW = wp.constant(wp.uint64(0xFFFFFFFF))
MULTIPLIER_HIGH = wp.constant(wp.uint64(2549297995355413924))
MULTIPLIER_LOW = wp.constant(wp.uint64(4865540595714422341))


@wp.func
def upper_half(a: wp.uint64, b: wp.uint64):
    """Return the upper 64 bits of a product of 128."""
    half = wp.uint64(32)
    a_high = a >> half
    a_low = a & LOW
    b_high = b >> half
    b_low = b & LOW

    middle = a_high * b_low + ((a_low * b_low) >> half)
    other = a_low * b_high + (middle & LOW)
    return a_high * b_high + (middle >> half) + (other >> half)


@wp.func
def draw_64(random: wp.array2d[wp.uint64], leg: int):
    """Return the next 64 bits of a leg's generator."""
    low = random[leg, 1]
    high = upper_half(low, MULTIPLIER_LOW) + random[leg, 0] * MULTIPLIER_LOW + low * MULTIPLIER_HIGH
    product = low * MULTIPLIER_LOW
    low = product + random[leg, 3]
    high = high + random[leg, 2]
    if low < product:
        high = high + wp.uint64(1)

    random[leg, 0] = high
    random[leg, 1] = low
    turns = high >> wp.uint64(58)
    mixed = high ^ low
    back = (wp.uint64(64) - turns) & wp.uint64(63)
    return (mixed >> turns) | (mixed << back)


@wp.func
def draw_32(random: wp.array2d[wp.uint64], leg: int):
    """Return the next 32 bits: the lower half of a draw, then its upper half."""
    if random[leg, 4] != wp.uint64(0):
        random[leg, 4] = wp.uint64(0)
        return random[leg, 5]
    drawn = draw_64(random, leg)
    random[leg, 4] = wp.uint64(1)
    random[leg, 5] = drawn >> wp.uint64(32)
    return drawn & LOW


@wp.func
def draw_start(random: wp.array2d[wp.uint64], leg: int, count: int):
    """Return what `integers(count)`, then `integers(2**63)` draw; the second is not looked at.

    Of a count that is a power of two NumPy rejects no draw.
    """
    drawn = (draw_32(random, leg) * wp.uint64(count)) >> wp.uint64(32)
    draw_64(random, leg)
    return int(drawn)
