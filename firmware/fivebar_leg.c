/* The kinematics of a closed five-bar leg; fivebar_leg.h says what each function does.
 *
 * `fivebar_sim.firmware` in Python is the same arithmetic, operation by operation: change both.
 */
#include "fivebar_leg.h"

#include <float.h>

/* The same bits everywhere need each operation rounded on its own, NaN and infinity included. */
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "fivebar_leg.c needs IEEE arithmetic: compile it without -ffast-math, -Ofast and the like"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "fivebar_leg.c needs float arithmetic in float: on x86 compile it with -mfpmath=sse -msse2"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

#ifdef FIVEBAR_DOUBLE
#define REAL(x) x
#define EPSILON DBL_EPSILON
typedef uint64_t digits;
#else
#define REAL(x) x##f
#define EPSILON FLT_EPSILON
typedef uint32_t digits;
#endif

#define LARGEST_ANGLE ((fivebar_real)FIVEBAR_LARGEST_ANGLE)

/* ---- Elementary functions ----------------------------------------------------------------- */

/* pi / 2 in three parts; products of the first two with up to 41 quarter turns are exact. */
#ifdef FIVEBAR_DOUBLE
#define QUARTER_1 1.5707963267948912
#define QUARTER_2 5.3903028581580306e-15
#define QUARTER_3 8.8437205661357006e-29
#define QUARTERS_PER_RADIAN 0.63661977236758138
#define TURNS_PER_RADIAN 0.15915494309189535
#define PI 3.1415926535897931
#define PI_REST 1.2246467991473532e-16
#define TAN_EIGHTH 0.41421356237309503
#define MANTISSA 53
#define WORD 64
#else
#define QUARTER_1 1.57079315f
#define QUARTER_2 3.17493686e-06f
#define QUARTER_3 2.56334407e-12f
#define QUARTERS_PER_RADIAN 0.636619747f
#define TURNS_PER_RADIAN 0.159154937f
#define PI 3.14159274f
#define PI_REST -8.74227766e-08f
#define TAN_EIGHTH 0.414213568f
#define MANTISSA 24
#define WORD 32
#endif

/* Of scripts/firmware_polynomials.py, ascending powers of x^2:
 * (sin(x) / x - 1) / x^2,   (cos(x) - 1 + x^2 / 2) / x^4,   (atan(x) / x - 1) / x^2 */
#ifdef FIVEBAR_DOUBLE
static const fivebar_real SINE[] = {-0.16666666666666666,    0.0083333333333333315,
                                    -0.00019841269841265065, 2.7557319219339167e-06,
                                    -2.5052106232447578e-08, 1.6058531618986147e-10,
                                    -7.5866971177069183e-13};
static const fivebar_real COSINE[] = {0.041666666666666664,   -0.0013888888888888887,
                                      2.4801587301584645e-05, -2.7557319221402824e-07,
                                      2.0876755791080422e-09, -1.1470460887609959e-11,
                                      4.7458719020432915e-14};
static const fivebar_real ARC[] = {
    -0.33333333333333331,  0.19999999999999804,  -0.14285714285659828,  0.11111111105155447,
    -0.090909087535008773, 0.076922963750321427, -0.066664248857382549, 0.058789289978347752,
    -0.052304542706502442, 0.045515932206265493, -0.034570561981427744, 0.016285756855221028};
#else
static const fivebar_real SINE[] = {-0.166666642f, 0.00833274797f, -0.000195878907f};
static const fivebar_real COSINE[] = {0.0416666642f, -0.00138883025f, 2.45479423e-05f};
static const fivebar_real ARC[] = {-0.333333313f, 0.199995399f, -0.142639562f, 0.107437313f,
                                   -0.0645192787f};
#endif
#define POLYNOMIAL(table, z) horner(table, (int)(sizeof(table) / sizeof(table[0])), z)

static fivebar_real horner(const fivebar_real *c, int count, fivebar_real z)
{
    fivebar_real sum = c[count - 1];
    int k;

    for (k = count - 2; k >= 0; k--) {
        sum = sum * z + c[k];
    }
    return sum;
}

static int is_finite(fivebar_real x)
{
    /* NaN and infinity less themselves are NaN. */
    return x - x == REAL(0.0);
}

/* The square root as one instruction, which IEEE 754 rounds correctly; a call of sqrtf would pull in
 * libm and errno. Without such an instruction it is found digit by digit. */
#if defined(FIVEBAR_SQRT_BY_DIGITS)
#define BY_DIGITS 1
#elif defined(__SSE2__)
#include <emmintrin.h>
#ifdef FIVEBAR_DOUBLE
#define ROOT(x) _mm_cvtsd_f64(_mm_sqrt_sd(_mm_setzero_pd(), _mm_set_sd(x)))
#else
#define ROOT(x) _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(x)))
#endif
#elif defined(__aarch64__) && defined(FIVEBAR_DOUBLE)
#define ROOT_ASM(y, x) __asm__("fsqrt %d0, %d1" : "=w"(y) : "w"(x))
#elif defined(__aarch64__)
#define ROOT_ASM(y, x) __asm__("fsqrt %s0, %s1" : "=w"(y) : "w"(x))
#elif defined(__ARM_FP) && (__ARM_FP & 8) && defined(FIVEBAR_DOUBLE)
#define ROOT_ASM(y, x) __asm__("vsqrt.f64 %P0, %P1" : "=w"(y) : "w"(x))
#elif defined(__ARM_FP) && (__ARM_FP & 4) && !defined(FIVEBAR_DOUBLE)
#define ROOT_ASM(y, x) __asm__("vsqrt.f32 %0, %1" : "=t"(y) : "t"(x))
#elif defined(__riscv_flen) && __riscv_flen >= 64 && defined(FIVEBAR_DOUBLE)
#define ROOT_ASM(y, x) __asm__("fsqrt.d %0, %1" : "=f"(y) : "f"(x))
#elif defined(__riscv_flen) && __riscv_flen >= 32 && !defined(FIVEBAR_DOUBLE)
#define ROOT_ASM(y, x) __asm__("fsqrt.s %0, %1" : "=f"(y) : "f"(x))
#elif defined(__wasm__) && defined(FIVEBAR_DOUBLE)
#define ROOT(x) __builtin_sqrt(x)
#elif defined(__wasm__)
#define ROOT(x) __builtin_sqrtf(x)
#else
#define BY_DIGITS 1
#endif

/* Return the square root of x >= 0. */
static fivebar_real square_root(fivebar_real x)
{
#if defined(ROOT)
    return ROOT(x);
#elif defined(ROOT_ASM)
    fivebar_real y;

    ROOT_ASM(y, x);
    return y;
#else
    fivebar_real scale = REAL(1.0);
    digits mantissa;
    digits rest = 0;
    digits root = 0;
    int k;

    if (!(x > REAL(0.0))) {
        return REAL(0.0);
    }
    if (!is_finite(x)) {
        return x;
    }
    /* Powers of two are exact: x becomes 1 .. 4, and its digits a whole number. */
    while (x < REAL(1.0)) {
        x *= REAL(4.0);
        scale *= REAL(0.5);
    }
    while (x >= REAL(4.0)) {
        x *= REAL(0.25);
        scale *= REAL(2.0);
    }
    mantissa = (digits)(x * (fivebar_real)((digits)1 << (MANTISSA - 1)));
    mantissa <<= WORD - 1 - MANTISSA;

    /* One digit more than the result has; the remainder cannot be zero where that digit is 1. */
    for (k = 0; k <= MANTISSA; k++) {
        digits next = (root << 2) | 1;

        rest = (rest << 2) | (mantissa >> (WORD - 2));
        mantissa <<= 2;
        root <<= 1;
        if (rest >= next) {
            rest -= next;
            root |= 1;
        }
    }
    return (fivebar_real)((root + 1) >> 1) * (scale / (fivebar_real)((digits)1 << (MANTISSA - 1)));
#endif
}

static fivebar_real magnitude(fivebar_real x)
{
    return x < REAL(0.0) ? -x : x;
}

/* Return the square root of a difference that rounding may have left below 0. */
static fivebar_real positive_root(fivebar_real x)
{
    return square_root(x > REAL(0.0) ? x : REAL(0.0));
}

/* Return x less a whole number of quarter turns, whose count is stored; |x| is at most
 * FIVEBAR_LARGEST_ANGLE, and quarters_each is 1, or 4 for whole turns. */
static fivebar_real reduce(fivebar_real x, fivebar_real per_radian, int quarters_each, int *count)
{
    fivebar_real scaled = x * per_radian;
    int nearest = (int)(scaled < REAL(0.0) ? scaled - REAL(0.5) : scaled + REAL(0.5));
    fivebar_real quarters = (fivebar_real)(nearest * quarters_each);

    *count = nearest;
    return ((x - quarters * QUARTER_1) - quarters * QUARTER_2) - quarters * QUARTER_3;
}

/* Return x less whole turns, within half a turn of 0. */
static fivebar_real within_turn(fivebar_real x)
{
    int turns;

    return reduce(x, TURNS_PER_RADIAN, 4, &turns);
}

/* Store (cos, sin) of an angle of at most FIVEBAR_LARGEST_ANGLE. */
static void unit(fivebar_real angle, fivebar_real e[2])
{
    int quarters;
    fivebar_real r = reduce(angle, QUARTERS_PER_RADIAN, 1, &quarters);
    fivebar_real z = r * r;
    fivebar_real sine = r + (r * z) * POLYNOMIAL(SINE, z);
    fivebar_real cosine = (REAL(1.0) - REAL(0.5) * z) + (z * z) * POLYNOMIAL(COSINE, z);
    fivebar_real c = quarters & 1 ? sine : cosine;
    fivebar_real s = quarters & 1 ? cosine : sine;

    e[0] = (quarters + 1) & 2 ? -c : c;
    e[1] = quarters & 2 ? -s : s;
}

/* Return the direction of (x, z) in (-pi, pi], 0 where both are zero. */
static fivebar_real direction(fivebar_real z, fivebar_real x)
{
    fivebar_real wide = magnitude(x);
    fivebar_real high = magnitude(z);
    fivebar_real more = high > wide ? high : wide;
    fivebar_real less = high > wide ? wide : high;
    int steep = less > TAN_EIGHTH * more;
    fivebar_real t;
    fivebar_real t2;
    fivebar_real angle;

    if (!(more > REAL(0.0))) {
        return REAL(0.0);
    }
    /* Within an eighth of a turn of the axis or of the diagonal; that is one division either way. */
    t = (steep ? less - more : less) / (steep ? less + more : more);
    t2 = t * t;
    angle = t + (t * t2) * POLYNOMIAL(ARC, t2);
    /* A float's pi is not pi: its rest is added before the last rounding. */
    if (steep) {
        angle = REAL(0.25) * PI + (angle + REAL(0.25) * PI_REST);
    }
    if (high > wide) {
        angle = REAL(0.5) * PI - (angle - REAL(0.5) * PI_REST);
    }
    if (x < REAL(0.0)) {
        angle = PI - (angle - PI_REST);
    }
    return z < REAL(0.0) && angle < PI ? -angle : angle;
}

/* ---- Plane vectors ------------------------------------------------------------------------ */

static fivebar_real cross(const fivebar_real a[2], const fivebar_real b[2])
{
    return a[0] * b[1] - a[1] * b[0];
}

/* Store the product of two complex numbers; the result may not be one of them. */
static void multiply(const fivebar_real a[2], const fivebar_real b[2], fivebar_real ab[2])
{
    ab[0] = a[0] * b[0] - a[1] * b[1];
    ab[1] = a[0] * b[1] + a[1] * b[0];
}

static int is_sign(int s)
{
    return s == 1 || s == -1;
}

static int are_finite(const fivebar_real *x, int count)
{
    int k;

    for (k = 0; k < count; k++) {
        if (!is_finite(x[k])) {
            return 0;
        }
    }
    return 1;
}

/* ---- A leg -------------------------------------------------------------------------------- */

static void prepare_chain(fivebar_chain *chain, fivebar_real near, fivebar_real far,
                          fivebar_real slack)
{
    fivebar_real inner = magnitude(near - far);
    fivebar_real outer = near + far;
    fivebar_real hole = inner > slack ? inner - slack : REAL(0.0);
    fivebar_real reach = outer + slack;

    chain->inner = inner;
    chain->outer = outer;
    chain->low = inner * inner;
    chain->high = outer * outer;
    chain->least = hole * hole;
    chain->most = reach * reach;
    chain->product = (near - far) * outer;
}

int fivebar_prepare(fivebar_leg *leg)
{
    const fivebar_real lengths[6] = {leg->L1, leg->L2, leg->L3, leg->L4, leg->L5, leg->L6};
    fivebar_real left = leg->L1 + leg->L2 + leg->L6;
    fivebar_real right = leg->L4 + leg->L3;
    fivebar_real size = left > right ? left : right;
    fivebar_real shortest = REAL(0.001) * size;
    fivebar_real total = leg->L1 + leg->L2 + leg->L3 + leg->L4 + leg->L5;
    fivebar_real offset[2];
    fivebar_real turned[2];
    fivebar_real radius2;
    fivebar_real radius;
    fivebar_real slack;
    int k;

    if (!are_finite(lengths, 6) || !is_finite(leg->bend) || !is_finite(leg->tilt)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (!is_sign(leg->s_A) || !is_sign(leg->s_E) || !is_sign(leg->assembly)) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    if (!(size >= REAL(1e-4) && size <= REAL(1e3))) {
        return FIVEBAR_BAD_LEG;
    }
    for (k = 0; k < 4; k++) {
        if (!(lengths[k] >= shortest)) {
            return FIVEBAR_BAD_LEG;
        }
    }
    if (!(leg->L5 >= REAL(0.0) && leg->L6 >= REAL(0.0))) {
        return FIVEBAR_BAD_LEG;
    }
    /* A closed polygon: no side longer than all others together. */
    for (k = 0; k < 5; k++) {
        if (!(lengths[k] <= (total - lengths[k]) * (REAL(1.0) + REAL(8.0) * EPSILON))) {
            return FIVEBAR_BAD_LEG;
        }
    }
    if (!(magnitude(leg->bend) <= PI && magnitude(leg->tilt) <= PI)) {
        return FIVEBAR_BAD_LEG;
    }

    unit(leg->bend, turned);
    offset[0] = leg->L2 + leg->L6 * turned[0];
    offset[1] = leg->L6 * turned[1];
    radius2 = offset[0] * offset[0] + offset[1] * offset[1];
    /* Without an extension exactly L2, which the root of its square may miss. */
    radius = leg->L6 > REAL(0.0) ? square_root(radius2) : leg->L2;
    if (!(radius >= shortest)) {
        return FIVEBAR_BAD_LEG;
    }

    unit(leg->tilt, turned);
    leg->A[0] = -(REAL(0.5) * leg->L5) * turned[0];
    leg->A[1] = -(REAL(0.5) * leg->L5) * turned[1];
    leg->foot[0] = offset[0] / leg->L2;
    leg->foot[1] = offset[1] / leg->L2;
    leg->back[0] = leg->L6 > REAL(0.0) ? leg->L2 * offset[0] / radius2 : REAL(1.0);
    leg->back[1] = leg->L6 > REAL(0.0) ? -(leg->L2 * offset[1]) / radius2 : REAL(0.0);
    /* As far as joints are off by rounding: an end of reach that is meant exactly still counts. */
    slack = REAL(4.0) * EPSILON * (size + leg->L5);
    prepare_chain(&leg->to_foot, leg->L1, radius, slack);
    prepare_chain(&leg->to_C, leg->L4, leg->L3, slack);
    prepare_chain(&leg->knee_knee, leg->L2, leg->L3, slack);
    leg->apart2 = (REAL(4.0) * slack) * (REAL(4.0) * slack);
    return FIVEBAR_OK;
}

/* ---- Angles from the foot ----------------------------------------------------------------- */

/* |r|^2 up to which a chain ends on its motor [m^2]: far below any rounding of a position. */
#define ON_MOTOR REAL(1e-30)

static int spans(const fivebar_chain *chain, fivebar_real d2)
{
    return d2 >= chain->least && d2 <= chain->most;
}

/* Store the direction of the link at the motor, 2 near |r|^2 long, and |r|^2, for a chain that ends
 * at r from its motor: the law of cosines, added as directions. */
static int crank(const fivebar_chain *chain, const fivebar_real r[2], int s, fivebar_real e[2],
                 fivebar_real *d2)
{
    fivebar_real square = r[0] * r[0] + r[1] * r[1];
    fivebar_real n = square + chain->product;
    fivebar_real p = (chain->high - square) * (square - chain->low);
    fivebar_real root;

    if (!spans(chain, square)) {
        return FIVEBAR_UNREACHABLE;
    }
    *d2 = square;
    if (square < ON_MOTOR) {
        e[0] = REAL(1.0);
        e[1] = REAL(0.0);
        return FIVEBAR_OK;
    }
    root = (fivebar_real)s * positive_root(p);
    e[0] = r[0] * n - r[1] * root;
    e[1] = r[1] * n + r[0] * root;
    return FIVEBAR_OK;
}

/* Store the directions of both cranks, of any length above 0. */
static int cranks(const fivebar_leg *leg, const fivebar_real foot[2], int s_A, int s_E,
                  fivebar_real e_A[2], fivebar_real e_E[2])
{
    fivebar_real AF[2];
    fivebar_real EC[2];
    fivebar_real d2;
    int status;

    AF[0] = foot[0] - leg->A[0];
    AF[1] = foot[1] - leg->A[1];
    status = crank(&leg->to_foot, AF, s_A, e_A, &d2);
    if (status != FIVEBAR_OK) {
        return status;
    }
    /* E is at -A. */
    EC[0] = foot[0] + leg->A[0];
    EC[1] = foot[1] + leg->A[1];
    /* With an extension E's side ends at C, which is known once side A has placed L2. */
    if (leg->L6 > REAL(0.0)) {
        fivebar_real AB[2];
        fivebar_real BF[2];
        fivebar_real BC[2];

        AB[0] = d2 < ON_MOTOR ? leg->L1 : e_A[0] / (REAL(2.0) * d2);
        AB[1] = d2 < ON_MOTOR ? REAL(0.0) : e_A[1] / (REAL(2.0) * d2);
        BF[0] = AF[0] - AB[0];
        BF[1] = AF[1] - AB[1];
        multiply(leg->back, BF, BC);
        EC[0] = (AB[0] + BC[0]) + REAL(2.0) * leg->A[0];
        EC[1] = (AB[1] + BC[1]) + REAL(2.0) * leg->A[1];
    }
    return crank(&leg->to_C, EC, s_E, e_E, &d2);
}

int fivebar_inverse(const fivebar_leg *leg, const fivebar_real foot[2], int s_A, int s_E,
                    fivebar_real theta[2])
{
    fivebar_real e_A[2];
    fivebar_real e_E[2];
    int status;

    if (!are_finite(foot, 2)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (!is_sign(s_A) || !is_sign(s_E)) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    status = cranks(leg, foot, s_A, s_E, e_A, e_E);
    if (status != FIVEBAR_OK) {
        return status;
    }
    theta[0] = direction(e_A[1], e_A[0]);
    theta[1] = direction(e_E[1], e_E[0]);
    return FIVEBAR_OK;
}

int fivebar_inverse_all(const fivebar_leg *leg, const fivebar_real foot[2],
                        fivebar_real theta[4][2], int status[4])
{
    int own = (leg->s_A > 0 ? 2 : 0) + (leg->s_E > 0 ? 1 : 0);
    int k;

    for (k = 0; k < 4; k++) {
        status[k] = fivebar_inverse(leg, foot, k & 2 ? 1 : -1, k & 1 ? 1 : -1, theta[k]);
    }
    for (k = 0; k < 4; k++) {
        if (status[k] == FIVEBAR_OK) {
            return FIVEBAR_OK;
        }
    }
    return status[own];
}

static int check_angles(const fivebar_real theta[2])
{
    if (!are_finite(theta, 2)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (!(magnitude(theta[0]) <= LARGEST_ANGLE &&
          magnitude(theta[1]) <= LARGEST_ANGLE)) {
        return FIVEBAR_OUT_OF_LIMITS;
    }
    return FIVEBAR_OK;
}

int fivebar_inverse_nearest(const fivebar_leg *leg, const fivebar_real foot[2],
                            const fivebar_real now[2], fivebar_real theta[2])
{
    fivebar_real every[4][2];
    fivebar_real nearest[2] = {REAL(0.0), REAL(0.0)};
    fivebar_real least = REAL(-1.0);
    int each[4];
    int status = check_angles(now);
    int k;

    if (status != FIVEBAR_OK) {
        return status;
    }
    status = fivebar_inverse_all(leg, foot, every, each);
    if (status != FIVEBAR_OK) {
        return status;
    }
    for (k = 0; k < 4; k++) {
        if (each[k] == FIVEBAR_OK) {
            fivebar_real step_A = within_turn(every[k][0] - now[0]);
            fivebar_real step_E = within_turn(every[k][1] - now[1]);
            fivebar_real cost = step_A * step_A + step_E * step_E;

            if (least < REAL(0.0) || cost < least) {
                least = cost;
                nearest[0] = now[0] + step_A;
                nearest[1] = now[1] + step_E;
            }
        }
    }
    theta[0] = nearest[0];
    theta[1] = nearest[1];
    return FIVEBAR_OK;
}

/* ---- Positions from angles ---------------------------------------------------------------- */

typedef struct {
    fivebar_real AB[2];
    fivebar_real ED[2];
    fivebar_real BD[2];
    fivebar_real BC[2];
} pose;

/* Store the vectors of a pose: C is the crossing of the circles about B and D. */
static int close_loop(const fivebar_leg *leg, const fivebar_real theta[2], int assembly, pose *p)
{
    fivebar_real d2;
    fivebar_real q;
    fivebar_real along;
    fivebar_real across;
    int status = check_angles(theta);

    if (status != FIVEBAR_OK) {
        return status;
    }
    if (!is_sign(assembly)) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    unit(theta[0], p->AB);
    unit(theta[1], p->ED);
    p->AB[0] *= leg->L1;
    p->AB[1] *= leg->L1;
    p->ED[0] *= leg->L4;
    p->ED[1] *= leg->L4;
    /* AE is -2 A. */
    p->BD[0] = (p->ED[0] - p->AB[0]) - REAL(2.0) * leg->A[0];
    p->BD[1] = (p->ED[1] - p->AB[1]) - REAL(2.0) * leg->A[1];
    d2 = p->BD[0] * p->BD[0] + p->BD[1] * p->BD[1];
    if (!(spans(&leg->knee_knee, d2) && d2 > leg->apart2)) {
        return FIVEBAR_LOOP_OPEN;
    }
    q = (leg->knee_knee.high - d2) * (d2 - leg->knee_knee.low);
    along = (d2 + leg->knee_knee.product) / (REAL(2.0) * d2);
    across = positive_root(q) / (REAL(2.0) * d2);
    across = (fivebar_real)assembly * across;
    p->BC[0] = along * p->BD[0] - across * p->BD[1];
    p->BC[1] = along * p->BD[1] + across * p->BD[0];
    return FIVEBAR_OK;
}

int fivebar_joints(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                   fivebar_points *points)
{
    pose p;
    fivebar_real BF[2];
    int status = close_loop(leg, theta, assembly, &p);
    int k;

    if (status != FIVEBAR_OK) {
        return status;
    }
    multiply(leg->foot, p.BC, BF);
    for (k = 0; k < 2; k++) {
        points->B[k] = leg->A[k] + p.AB[k];
        points->C[k] = points->B[k] + p.BC[k];
        points->D[k] = p.ED[k] - leg->A[k];
        points->F[k] = points->B[k] + BF[k];
    }
    return FIVEBAR_OK;
}

int fivebar_forward(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                    fivebar_real foot[2])
{
    fivebar_points points;
    int status = fivebar_joints(leg, theta, assembly, &points);

    if (status != FIVEBAR_OK) {
        return status;
    }
    foot[0] = points.F[0];
    foot[1] = points.F[1];
    return FIVEBAR_OK;
}

int fivebar_knees(const fivebar_leg *leg, const fivebar_real theta[2], fivebar_real B[2],
                  fivebar_real D[2])
{
    fivebar_real e[2];
    int status = check_angles(theta);

    if (status != FIVEBAR_OK) {
        return status;
    }
    unit(theta[0], e);
    B[0] = leg->A[0] + e[0] * leg->L1;
    B[1] = leg->A[1] + e[1] * leg->L1;
    unit(theta[1], e);
    D[0] = e[0] * leg->L4 - leg->A[0];
    D[1] = e[1] * leg->L4 - leg->A[1];
    return FIVEBAR_OK;
}

/* ---- Rates and torques -------------------------------------------------------------------- */

/* Sine of the angle at C below which rounding decides the Jacobian. */
#ifdef FIVEBAR_DOUBLE
#define SINGULAR 2.384185791015625e-07
#else
#define SINGULAR 0.001953125f
#endif

/* C moves so that L2 and L3 keep their lengths:
 *     dC / dtheta_A = (AB x BC) / (BC x DC) (DC_z, -DC_x)
 *     dC / dtheta_E = (ED x DC) / (BC x DC) (-BC_z, BC_x)
 * and F = B + foot (C - B), so dF = foot dC + (1 - foot) dB. */
int fivebar_jacobian(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                     fivebar_real J[2][2])
{
    pose p;
    fivebar_real DC[2];
    fivebar_real dC[2];
    fivebar_real dB[2];
    fivebar_real by_C[2];
    fivebar_real by_B[2];
    fivebar_real rest[2];
    fivebar_real m;
    fivebar_real turn;
    int status = close_loop(leg, theta, assembly, &p);

    if (status != FIVEBAR_OK) {
        return status;
    }
    DC[0] = p.BC[0] - p.BD[0];
    DC[1] = p.BC[1] - p.BD[1];
    m = cross(p.BC, DC);
    if (!(magnitude(m) > SINGULAR * (leg->L2 * leg->L3))) {
        return FIVEBAR_SINGULAR;
    }

    turn = cross(p.AB, p.BC) / m;
    dC[0] = turn * DC[1];
    dC[1] = -(turn * DC[0]);
    dB[0] = -p.AB[1];
    dB[1] = p.AB[0];
    rest[0] = REAL(1.0) - leg->foot[0];
    rest[1] = -leg->foot[1];
    multiply(leg->foot, dC, by_C);
    multiply(rest, dB, by_B);
    J[0][0] = by_C[0] + by_B[0];
    J[1][0] = by_C[1] + by_B[1];

    turn = cross(p.ED, DC) / m;
    dC[0] = -(turn * p.BC[1]);
    dC[1] = turn * p.BC[0];
    multiply(leg->foot, dC, by_C);
    J[0][1] = by_C[0];
    J[1][1] = by_C[1];
    return FIVEBAR_OK;
}

int fivebar_torque(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                   const fivebar_real force[2], fivebar_real tau[2])
{
    fivebar_real J[2][2];
    int status;

    if (!are_finite(force, 2)) {
        return FIVEBAR_NOT_FINITE;
    }
    status = fivebar_jacobian(leg, theta, assembly, J);
    if (status != FIVEBAR_OK) {
        return status;
    }
    tau[0] = -(J[0][0] * force[0] + J[1][0] * force[1]);
    tau[1] = -(J[0][1] * force[0] + J[1][1] * force[1]);
    return FIVEBAR_OK;
}

/* ---- The workspace ------------------------------------------------------------------------ */

static int reaches(const fivebar_leg *leg, const fivebar_real foot[2], int s_A)
{
    fivebar_real e_A[2];
    fivebar_real e_E[2];

    return cranks(leg, foot, s_A, 1, e_A, e_E) == FIVEBAR_OK;
}

int fivebar_reaches(const fivebar_leg *leg, const fivebar_real foot[2], int s_A)
{
    if (!are_finite(foot, 2)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (s_A != 0 && !is_sign(s_A)) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    if ((s_A != 1 && reaches(leg, foot, -1)) || (s_A != -1 && reaches(leg, foot, 1))) {
        return FIVEBAR_OK;
    }
    return FIVEBAR_UNREACHABLE;
}

typedef struct {
    const fivebar_leg *leg;
    const fivebar_real *point; /* that the nearest one is wanted for */
    fivebar_real away_A[2];    /* direction from A if the point is on it */
    fivebar_real away_E[2];
    fivebar_real best[2];
    int found; /* whether there is a best one yet */
} search;

/* Take a candidate if the foot can be put there. */
static int take(search *s, fivebar_real x, fivebar_real z)
{
    fivebar_real c[2];

    c[0] = x;
    c[1] = z;
    if (fivebar_reaches(s->leg, c, 0) != FIVEBAR_OK) {
        return 0;
    }
    s->best[0] = x;
    s->best[1] = z;
    s->found = 1;
    return 1;
}

/* Take a candidate that is nearer than the best one: |p - best|^2 - |p - c|^2 as one product, which
 * keeps its digits where p is far away. One that rounding put out of reach is moved by some units
 * in the last place, doubled `nudges` times. */
static void consider(search *s, const fivebar_real c[2], int nudges)
{
    const fivebar_real *p = s->point;
    fivebar_real x = (c[0] - s->best[0]) * ((p[0] - s->best[0]) + (p[0] - c[0]));
    fivebar_real z = (c[1] - s->best[1]) * ((p[1] - s->best[1]) + (p[1] - c[1]));
    fivebar_real step = EPSILON * (s->leg->to_foot.outer + s->leg->L5);
    int k;

    if ((s->found && !(x + z > REAL(0.0))) || take(s, c[0], c[1])) {
        return;
    }
    for (; nudges > 0; nudges--) {
        for (k = 0; k < 9; k++) {
            if (take(s, c[0] + step * (fivebar_real)(k / 3 - 1),
                     c[1] + step * (fivebar_real)(k % 3 - 1))) {
                return;
            }
        }
        step = REAL(2.0) * step;
    }
}

/* Store the direction from a centre to the point; from the centre every direction is as near. */
static void ray_to(const search *s, const fivebar_real centre[2], fivebar_real outer,
                   const fivebar_real away[2], fivebar_real ray[2])
{
    fivebar_real x = s->point[0] - centre[0];
    fivebar_real z = s->point[1] - centre[1];
    fivebar_real d = square_root(x * x + z * z);
    int off = d > REAL(4.0) * EPSILON * outer;

    ray[0] = off ? x / d : away[0];
    ray[1] = off ? z / d : away[1];
}

static void consider_circle(search *s, const fivebar_real centre[2], fivebar_real radius,
                            const fivebar_real ray[2], int nudges)
{
    fivebar_real c[2];

    c[0] = centre[0] + radius * ray[0];
    c[1] = centre[1] + radius * ray[1];
    consider(s, c, nudges);
}

/* Consider the points of one chain's two circles in the direction of the point. */
static void consider_circles(search *s, const fivebar_chain *chain, const fivebar_real centre[2],
                             const fivebar_real away[2])
{
    fivebar_real ray[2];

    ray_to(s, centre, chain->outer, away, ray);
    if (chain->least > REAL(0.0)) {
        consider_circle(s, centre, chain->inner, ray, 0);
    }
    consider_circle(s, centre, chain->outer, ray, 0);
}

/* Consider the two crossings of a circle about A with one about E. */
static void consider_corners(search *s, fivebar_real r_A, fivebar_real r_E)
{
    const fivebar_real *A = s->leg->A;
    fivebar_real d = s->leg->L5;
    fivebar_real sum = r_A + r_E;
    fivebar_real gap = r_A - r_E;
    fivebar_real h2 = ((sum - d) * (sum + d)) * ((d - gap) * (d + gap));
    fivebar_real a = REAL(0.5) * d + sum * gap / (REAL(2.0) * d);
    fivebar_real h = positive_root(h2) / (REAL(2.0) * d);
    fivebar_real c[2];
    int side;

    for (side = -1; side <= 1; side += 2) {
        fivebar_real across = (fivebar_real)side * h;
        fivebar_real u[2];

        u[0] = REAL(-2.0) * A[0] / d;
        u[1] = REAL(-2.0) * A[1] / d;
        c[0] = A[0] + (a * u[0] - across * u[1]);
        c[1] = A[1] + (a * u[1] + across * u[0]);
        consider(s, c, 0);
    }
}

/* Without an extension the boundary is made of arcs of the chains' circles, which end in corners, so
 * the nearest point is the foot of a perpendicular on a circle, or a corner. */
static void search_rings(search *s)
{
    const fivebar_leg *leg = s->leg;
    fivebar_real E[2];
    int k;

    E[0] = -leg->A[0];
    E[1] = -leg->A[1];
    consider_circles(s, &leg->to_C, E, s->away_E);
    for (k = 0; k < 4 && leg->L5 > REAL(0.0); k++) {
        if (((k & 2) || leg->to_foot.least > REAL(0.0)) &&
            ((k & 1) || leg->to_C.least > REAL(0.0))) {
            consider_corners(s, k & 2 ? leg->to_foot.outer : leg->to_foot.inner,
                             k & 1 ? leg->to_C.outer : leg->to_C.inner);
        }
    }
}

/* ---- Coupler curves ----------------------------------------------------------------------- */

/* With C at the edge of E's reach, |EC| = R, a foot on an extension moves on a coupler curve of the
 * four-bar A, B, C, E. All of the curve is in reach, so its nearest point may be taken wherever it
 * is. A four-bar has its crank's pivot in the origin, the rocker's at (base, 0). */
typedef struct {
    fivebar_real crank;
    fivebar_real coupler;
    fivebar_real rocker;
    fivebar_real base;
    fivebar_real offset[2]; /* F from the crank's end, over the coupler; complex numbers */
    fivebar_real point[2];  /* that the nearest one is wanted for, in this frame */
    fivebar_real middle;    /* of the crank's range [rad] */
    fivebar_real half;      /* of the range's width [rad] */
    fivebar_real sign;      /* of the two curves: +1, -1 */
    int swapped;            /* E has the crank, and the frame is turned by half a turn */
    int turning;            /* the crank goes all around; a curve for each side of the rocker */
    int single;             /* one range about 0 or pi; else two, mirror images */
} four_bar;

/* A place on a coupler curve. */
typedef struct {
    fivebar_real F[2];
    fivebar_real along[2]; /* its velocity along the curve, to some scale */
    fivebar_real r[2];     /* from the crank's end to the rocker's pivot */
    fivebar_real slope;    /* of how near it is to the point: + while it comes nearer */
} place;

/* Intervals on a curve (or half of one that is single), parts of an interval that needs them, and
 * steps to a minimum within one. */
#define INTERVALS 32
#define PARTS 8
#define STEPS 12

/* Tangent of what a direction may turn within an interval. */
#define TURN REAL(0.5)

/* Where the first interval begins: nowhere near the symmetric poses, where branches may cross. */
#define BEGIN REAL(0.4375)

/* How often the doubled unit in the last place may move a point back into reach. */
#define NUDGES 6

/* Return the crank's angle, 0 .. pi, at a distance from its end to the rocker's pivot. */
static fivebar_real angle_at(const four_bar *bar, fivebar_real distance)
{
    fivebar_real near = magnitude(bar->crank - bar->base);
    fivebar_real far = bar->crank + bar->base;
    fivebar_real sine = positive_root((distance - near) * (distance + near));
    fivebar_real cosine = positive_root((far - distance) * (far + distance));

    return REAL(2.0) * direction(sine, cosine);
}

/* Set the crank's range; 0 if there is no pose. */
static int set_range(four_bar *bar)
{
    fivebar_real near = magnitude(bar->crank - bar->base);
    fivebar_real far = bar->crank + bar->base;
    fivebar_real low = magnitude(bar->coupler - bar->rocker);
    fivebar_real high = bar->coupler + bar->rocker;
    fivebar_real least = angle_at(bar, low);
    fivebar_real most = angle_at(bar, high);
    int from_0 = low <= near;
    int to_pi = high >= far;

    bar->turning = from_0 && to_pi;
    bar->single = from_0 != to_pi;
    bar->middle = REAL(0.5) * (least + most);
    bar->half = REAL(0.5) * (most - least);
    if (bar->single) {
        bar->middle = from_0 ? REAL(0.0) : PI;
        bar->half = from_0 ? most : PI - least;
    }
    return high >= near && low <= far;
}

/* Set the four-bar of a radius of E's reach. The crank is the one whose end keeps farther from the
 * other pivot: near that the coupler would turn with hardly any angle of the crank. */
static int set_bar(four_bar *bar, const search *s, const fivebar_real u[2], fivebar_real R)
{
    const fivebar_leg *leg = s->leg;
    fivebar_real one = magnitude(leg->L1 - leg->L5);
    fivebar_real two = magnitude(leg->L2 - R);
    fivebar_real of_A = one > two ? one : two;
    fivebar_real three = magnitude(R - leg->L5);
    fivebar_real four = magnitude(leg->L2 - leg->L1);
    fivebar_real of_E = three > four ? three : four;
    fivebar_real x = s->point[0] - leg->A[0];
    fivebar_real z = s->point[1] - leg->A[1];

    bar->swapped = !(of_A >= of_E);
    bar->crank = bar->swapped ? R : leg->L1;
    bar->coupler = leg->L2;
    bar->rocker = bar->swapped ? leg->L1 : R;
    bar->base = leg->L5;
    bar->offset[0] = bar->swapped ? REAL(1.0) - leg->foot[0] : leg->foot[0];
    bar->offset[1] = bar->swapped ? -leg->foot[1] : leg->foot[1];
    bar->point[0] = u[0] * x + u[1] * z;
    bar->point[1] = u[0] * z - u[1] * x;
    if (bar->swapped) {
        bar->point[0] = bar->base - bar->point[0];
        bar->point[1] = -bar->point[1];
    }
    return set_range(bar);
}

/* Store the place at w, 0 .. 4 once around the curve: a turn of the crank, or there and back. */
static void follow(const four_bar *bar, fivebar_real w, place *at)
{
    fivebar_real half = REAL(0.5);
    fivebar_real wrapped = w >= REAL(4.0) ? w - REAL(4.0) : w;
    int there = wrapped < REAL(2.0);
    fivebar_real part = there ? wrapped - REAL(1.0) : REAL(3.0) - wrapped;
    /* Flat at both ends, where the rocker's side changes. */
    fivebar_real swing = bar->half * (half * part * (REAL(3.0) - part * part));
    fivebar_real middle = bar->single ? bar->middle : bar->sign * bar->middle;
    fivebar_real theta = bar->turning ? bar->sign * (half * PI * wrapped) : middle + swing;
    fivebar_real side = bar->turning ? bar->sign : there ? REAL(1.0) : REAL(-1.0);
    fivebar_real sum = bar->coupler + bar->rocker;
    fivebar_real gap = bar->coupler - bar->rocker;
    fivebar_real X[2];
    fivebar_real V[2];
    fivebar_real W[2];
    fivebar_real S[2];
    fivebar_real d2;
    fivebar_real root;
    fivebar_real ahead;
    fivebar_real across;
    fivebar_real by_crank;
    fivebar_real by_coupler;

    unit(theta, X);
    X[0] = bar->crank * X[0];
    X[1] = bar->crank * X[1];
    at->r[0] = bar->base - X[0];
    at->r[1] = -X[1];
    d2 = at->r[0] * at->r[0] + at->r[1] * at->r[1];
    root = side * positive_root((sum * sum - d2) * (d2 - gap * gap));
    ahead = (d2 + sum * gap) / (REAL(2.0) * d2);
    across = root / (REAL(2.0) * d2);
    /* The coupler, what it carries to the foot, and the rocker from its pivot. */
    V[0] = ahead * at->r[0] - across * at->r[1];
    V[1] = ahead * at->r[1] + across * at->r[0];
    multiply(bar->offset, V, W);
    at->F[0] = X[0] + W[0];
    at->F[1] = X[1] + W[1];
    S[0] = V[0] - at->r[0];
    S[1] = V[1] - at->r[1];
    /* The rocker keeps its length where crank and coupler turn at these rates: never both 0 but at a
     * crossing of branches. */
    by_crank = half * root;
    by_coupler = cross(X, S);
    at->along[0] = W[1] * by_coupler - X[1] * by_crank;
    at->along[1] = X[0] * by_crank - W[0] * by_coupler;
    at->slope = (bar->point[0] - at->F[0]) * at->along[0] +
                (bar->point[1] - at->F[1]) * at->along[1];
}

static void consider_place(search *s, const four_bar *bar, const fivebar_real u[2],
                           const place *at)
{
    fivebar_real x = bar->swapped ? bar->base - at->F[0] : at->F[0];
    fivebar_real z = bar->swapped ? -at->F[1] : at->F[1];
    fivebar_real c[2];

    c[0] = s->leg->A[0] + (u[0] * x - u[1] * z);
    c[1] = s->leg->A[1] + (u[0] * z + u[1] * x);
    consider(s, c, NUDGES);
}

/* Consider the minimum between two places, if there is one: the slope's zero, by the Illinois
 * rule. */
static void consider_interval(search *s, const four_bar *bar, const fivebar_real u[2],
                              fivebar_real w, fivebar_real width, const place *start,
                              const place *end)
{
    fivebar_real a = REAL(0.0);
    fivebar_real b = REAL(1.0);
    fivebar_real f_a = start->slope;
    fivebar_real f_b = end->slope;
    place at;
    int k;

    if (!(f_a > REAL(0.0)) || f_b > REAL(0.0)) {
        return;
    }
    for (k = 0; k < STEPS; k++) {
        fivebar_real fall = f_b - f_a;
        fivebar_real next = b - f_b * (b - a) / (fall == REAL(0.0) ? REAL(1.0) : fall);

        follow(bar, w + next * width, &at);
        if ((at.slope > REAL(0.0)) != (f_b > REAL(0.0))) {
            a = b;
            f_a = f_b;
        } else {
            f_a = REAL(0.5) * f_a;
        }
        b = next;
        f_b = at.slope;
    }
    consider_place(s, bar, u, &at);
}

static int veers(const fivebar_real a[2], const fivebar_real b[2])
{
    return !(magnitude(cross(a, b)) <= TURN * (a[0] * b[0] + a[1] * b[1]));
}

/* Consider the minima of one of a four-bar's two curves, or of one half of a single one. */
static void search_curve(search *s, const four_bar *bar, const fivebar_real u[2])
{
    fivebar_real width = (bar->single ? REAL(2.0) : REAL(4.0)) / (fivebar_real)INTERVALS;
    fivebar_real first = bar->single && bar->sign < REAL(0.0) ? REAL(2.0) : REAL(0.0);
    fivebar_real w = first + BEGIN * width;
    place start;
    place end;
    int j;

    follow(bar, w, &start);
    /* Of a leg with all links in line the curve is a point, on which nothing falls. */
    consider_place(s, bar, u, &start);
    for (j = 1; j <= INTERVALS; j++) {
        fivebar_real next = first + ((fivebar_real)j + BEGIN) * width;

        follow(bar, next, &end);
        /* Where the foot or the crank's pose changes fast, a closer look. */
        if (veers(start.along, end.along) || veers(start.r, end.r)) {
            fivebar_real small = width / (fivebar_real)PARTS;
            int m;

            for (m = 0; m < PARTS; m++) {
                place between;

                follow(bar, w + (fivebar_real)(m + 1) * small, &between);
                consider_interval(s, bar, u, w + (fivebar_real)m * small, small, &start, &between);
                start = between;
            }
        } else {
            consider_interval(s, bar, u, w, width, &start, &end);
        }
        start = end;
        w = next;
    }
}

/* With an extension the boundary is made of coupler curves, beside the circles about A. */
static void search_curves(search *s)
{
    const fivebar_leg *leg = s->leg;
    int coaxial = !(leg->L5 > REAL(0.0));
    fivebar_real u[2];
    fivebar_real ray[2];
    four_bar bar;
    int k;

    u[0] = coaxial ? REAL(1.0) : -s->away_A[0];
    u[1] = coaxial ? REAL(0.0) : -s->away_A[1];
    ray_to(s, leg->A, leg->to_foot.outer, s->away_A, ray);
    for (k = leg->to_C.least > REAL(0.0) ? 0 : 2; k < 4; k++) {
        bar.sign = k & 1 ? REAL(-1.0) : REAL(1.0);
        if (!set_bar(&bar, s, u, k & 2 ? leg->to_C.outer : leg->to_C.inner)) {
            continue;
        }
        /* A, B and C are one rigid triangle about A: the curve is a circle. */
        if (coaxial) {
            place at;
            fivebar_real radius;

            follow(&bar, REAL(0.0), &at);
            radius = square_root(at.F[0] * at.F[0] + at.F[1] * at.F[1]);
            consider_circle(s, leg->A, radius, ray, NUDGES);
        } else {
            search_curve(s, &bar, u);
        }
    }
}

/* Coordinates from here on have no nearest point [m]. */
#define FARTHEST REAL(1e6)

int fivebar_nearest(const fivebar_leg *leg, const fivebar_real foot[2], fivebar_real nearest[2])
{
    search s;
    int coaxial = !(leg->L5 > REAL(0.0));
    int status = fivebar_reaches(leg, foot, 0);

    if (status == FIVEBAR_NOT_FINITE) {
        return status;
    }
    if (status == FIVEBAR_OK) {
        nearest[0] = foot[0];
        nearest[1] = foot[1];
        return FIVEBAR_OK;
    }
    /* Squares must not overflow. */
    if (!(magnitude(foot[0]) <= FARTHEST && magnitude(foot[1]) <= FARTHEST)) {
        return FIVEBAR_OUT_OF_LIMITS;
    }

    s.leg = leg;
    s.point = foot;
    s.best[0] = REAL(0.0);
    s.best[1] = REAL(0.0);
    s.found = 0;
    /* Of a point on a motor: away from the other one; down if they are coaxial. */
    s.away_A[0] = coaxial ? REAL(0.0) : REAL(2.0) * leg->A[0] / leg->L5;
    s.away_A[1] = coaxial ? REAL(-1.0) : REAL(2.0) * leg->A[1] / leg->L5;
    s.away_E[0] = coaxial ? REAL(0.0) : -s.away_A[0];
    s.away_E[1] = coaxial ? REAL(-1.0) : -s.away_A[1];
    consider_circles(&s, &leg->to_foot, leg->A, s.away_A);
    if (leg->L6 > REAL(0.0)) {
        search_curves(&s);
    } else {
        search_rings(&s);
    }
    if (!s.found) {
        return FIVEBAR_UNREACHABLE;
    }
    nearest[0] = s.best[0];
    nearest[1] = s.best[1];
    return FIVEBAR_OK;
}

/* ---- The hip ------------------------------------------------------------------------------ */

static int check_hip(const fivebar_hip *hip)
{
    if (!is_finite(hip->across) || !is_finite(hip->along)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (!is_sign(hip->side) || (hip->kind != FIVEBAR_SIDE_STEP && hip->kind != FIVEBAR_STEERING)) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    return FIVEBAR_OK;
}

/* With the axis as third coordinate the foot is at (p, q, .) and the leg plane at w from the axis;
 * u is the foot's coordinate within the plane, across the axis. */
int fivebar_hip_inverse(const fivebar_leg *leg, const fivebar_hip *hip, const fivebar_real foot[3],
                        int s_A, int s_E, fivebar_real angles[3])
{
    int side_step = hip->kind == FIVEBAR_SIDE_STEP;
    fivebar_real w = side_step ? -hip->across : hip->across;
    fivebar_real p = side_step ? foot[2] : foot[0];
    fivebar_real q = side_step ? -foot[1] : foot[1];
    fivebar_real r2 = p * p + q * q;
    fivebar_real r;
    fivebar_real u2;
    fivebar_real u;
    fivebar_real planar[2];
    fivebar_real theta[2];
    int status = check_hip(hip);

    if (!are_finite(foot, 3)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (status != FIVEBAR_OK) {
        return status;
    }
    /* Of a far point the square may overflow. */
    if (!is_finite(r2)) {
        return FIVEBAR_UNREACHABLE;
    }
    r = square_root(r2);
    u2 = (r - magnitude(w)) * (r + magnitude(w));
    if (!(u2 >= REAL(-8.0) * EPSILON * (w * w))) {
        return FIVEBAR_UNREACHABLE;
    }
    u = (fivebar_real)hip->side * positive_root(u2);
    planar[0] = side_step ? foot[0] : u - hip->along;
    planar[1] = side_step ? u - hip->along : foot[2];
    status = fivebar_inverse(leg, planar, s_A, s_E, theta);
    if (status != FIVEBAR_OK) {
        return status;
    }
    angles[0] = direction(q * u - p * w, p * u + q * w);
    angles[1] = theta[0];
    angles[2] = theta[1];
    return FIVEBAR_OK;
}

int fivebar_hip_forward(const fivebar_leg *leg, const fivebar_hip *hip,
                        const fivebar_real angles[3], int assembly, fivebar_real foot[3])
{
    fivebar_real phi[2];
    fivebar_real planar[2];
    fivebar_real e[2];
    int status = check_hip(hip);

    phi[0] = angles[0];
    phi[1] = REAL(0.0);
    if (status != FIVEBAR_OK) {
        return status;
    }
    status = check_angles(phi);
    if (status != FIVEBAR_OK) {
        return status;
    }
    status = fivebar_forward(leg, angles + 1, assembly, planar);
    if (status != FIVEBAR_OK) {
        return status;
    }
    unit(angles[0], e);
    if (hip->kind == FIVEBAR_SIDE_STEP) {
        fivebar_real u = hip->along + planar[1];

        foot[0] = planar[0];
        foot[1] = hip->across * e[0] - u * e[1];
        foot[2] = hip->across * e[1] + u * e[0];
    } else {
        fivebar_real u = hip->along + planar[0];

        foot[0] = u * e[0] - hip->across * e[1];
        foot[1] = u * e[1] + hip->across * e[0];
        foot[2] = planar[1];
    }
    return FIVEBAR_OK;
}

/* ---- Servos and gaits --------------------------------------------------------------------- */

/* How far beyond an end of its range a command still counts as on it, in steps. */
#define TIE REAL(0.0009765625)

static int check_servo(const fivebar_servo *servo)
{
    if (!is_finite(servo->offset) || !is_finite(servo->low) || !is_finite(servo->high)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (!is_sign(servo->direction) || !(servo->low < servo->high) ||
        !(servo->high - servo->low <= REAL(2.0) * PI * (REAL(1.0) + REAL(8.0) * EPSILON))) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    /* Compared without a difference, which might overflow. */
    if (servo->last <= servo->first || servo->first < -1000000 || servo->last > 1000000) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    return FIVEBAR_OK;
}

int fivebar_servo_command(const fivebar_servo *servo, fivebar_real theta, int32_t *command)
{
    fivebar_real half = REAL(0.5) * (servo->high - servo->low);
    fivebar_real from_middle = (servo->offset - (servo->low + half)) +
                               (fivebar_real)servo->direction * theta;
    fivebar_real span;
    fivebar_real steps;
    int32_t whole;
    int status = check_servo(servo);

    if (!is_finite(theta)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (status != FIVEBAR_OK) {
        return status;
    }
    if (!(magnitude(from_middle) <= LARGEST_ANGLE)) {
        return FIVEBAR_OUT_OF_LIMITS;
    }
    span = (fivebar_real)(servo->last - servo->first);
    /* The whole turn that is nearest to mid-range: no other can be within it. */
    steps = (within_turn(from_middle) + half) * (span / (servo->high - servo->low));
    if (!(steps >= -TIE && steps <= span + TIE)) {
        return FIVEBAR_OUT_OF_LIMITS;
    }
    whole = (int32_t)(steps + REAL(0.5));
    *command = servo->first + whole;
    return FIVEBAR_OK;
}

int fivebar_servo_angle(const fivebar_servo *servo, int32_t command, fivebar_real *theta)
{
    fivebar_real span;
    fivebar_real angle;
    int status = check_servo(servo);

    if (status != FIVEBAR_OK) {
        return status;
    }
    if (command < servo->first || command > servo->last) {
        return FIVEBAR_OUT_OF_LIMITS;
    }
    span = (fivebar_real)(servo->last - servo->first);
    angle = (servo->low - servo->offset) +
            (fivebar_real)(command - servo->first) * ((servo->high - servo->low) / span);
    if (!(magnitude(angle) <= LARGEST_ANGLE)) {
        return FIVEBAR_OUT_OF_LIMITS;
    }
    angle = within_turn((fivebar_real)servo->direction * angle);
    *theta = angle <= -PI || angle > PI ? PI : angle;
    return FIVEBAR_OK;
}

int fivebar_gait_at(const fivebar_gait *gait, fivebar_real phase, fivebar_real theta[2])
{
    fivebar_real place;
    int32_t row;
    int32_t next;
    int k;

    if (!is_finite(phase)) {
        return FIVEBAR_NOT_FINITE;
    }
    if (gait->rows < 2) {
        return FIVEBAR_BAD_ARGUMENT;
    }
    if (gait->periodic) {
        if (!(magnitude(phase) <= REAL(1e6))) {
            return FIVEBAR_OUT_OF_LIMITS;
        }
        phase = phase - (fivebar_real)(int32_t)phase;
        phase = phase < REAL(0.0) ? phase + REAL(1.0) : phase;
        place = phase * (fivebar_real)gait->rows;
        /* Both may round up to the next period. */
        place = place < (fivebar_real)gait->rows ? place : REAL(0.0);
    } else {
        if (!(phase >= REAL(0.0) && phase <= REAL(1.0))) {
            return FIVEBAR_OUT_OF_LIMITS;
        }
        place = phase * (fivebar_real)(gait->rows - 1);
    }
    row = (int32_t)place;
    next = row + 1 < gait->rows ? row + 1 : gait->periodic ? 0 : row;
    place = place - (fivebar_real)row;
    for (k = 0; k < 2; k++) {
        theta[k] = gait->theta[row][k] + place * (gait->theta[next][k] - gait->theta[row][k]);
    }
    return FIVEBAR_OK;
}

/* ---- The exported leg: classic ------------------------------------------------------------ */

const fivebar_leg FIVEBAR_LEG = {
#ifdef FIVEBAR_DOUBLE
    0.04, 0.06, 0.06, 0.04, 0.03, 0.0, /* L1..L6 [m] */
    0.0, 0.0, /* bend, tilt [rad] */
    -1, 1, -1, /* s_A, s_E, assembly */
    {-0.015, -0.0}, /* A */
    {1.0, 0.0}, /* foot */
    {1.0, 0.0}, /* back */
    {0.019999999999999997, 0.1, 0.00039999999999999986, 0.010000000000000002, 0.0003999999999999953, 0.010000000000000023, -0.0019999999999999996}, /* to_foot */
    {0.019999999999999997, 0.1, 0.00039999999999999986, 0.010000000000000002, 0.0003999999999999953, 0.010000000000000023, -0.0019999999999999996}, /* to_C */
    {0.0, 0.12, 0.0, 0.0144, 0.0, 0.014400000000000026, 0.0}, /* knee_knee */
    2.133079887717616e-31 /* apart2 */
#else
    0.04f, 0.06f, 0.06f, 0.04f, 0.03f, 0.0f, /* L1..L6 [m] */
    0.0f, 0.0f, /* bend, tilt [rad] */
    -1, 1, -1, /* s_A, s_E, assembly */
    {-0.015f, -0.0f}, /* A */
    {1.0f, 0.0f}, /* foot */
    {1.0f, 0.0f}, /* back */
    {0.02f, 0.099999994f, 0.0004f, 0.009999999f, 0.00039999752f, 0.010000011f, -0.0019999999f}, /* to_foot */
    {0.02f, 0.099999994f, 0.0004f, 0.009999999f, 0.00039999752f, 0.010000011f, -0.0019999999f}, /* to_C */
    {0.0f, 0.12f, 0.0f, 0.0144f, 0.0f, 0.014400014f, 0.0f}, /* knee_knee */
    6.148184e-14f /* apart2 */
#endif
};
