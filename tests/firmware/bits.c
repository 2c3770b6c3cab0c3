/* The bits of everything that the firmware computes, for legs and points drawn from a counter.
 *
 * tests/firmware_bits.py draws the same in NumPy. Freestanding: it also runs in WebAssembly. */
#include "fivebar_leg.h"

#ifdef FIVEBAR_DOUBLE
#define REAL(x) x
#else
#define REAL(x) x##f
#endif

uint64_t digest(uint32_t first, uint32_t count);

typedef struct {
    uint32_t index;
    uint32_t sum;
} sample;

#ifdef __wasm__
/* Without a C library the compiler still calls this for initialisers. */
void *memset(void *to, int value, __SIZE_TYPE__ count);
void *memset(void *to, int value, __SIZE_TYPE__ count)
{
    unsigned char *bytes = (unsigned char *)to;

    while (count-- > 0) {
        bytes[count] = (unsigned char)value;
    }
    return to;
}
#endif

/* Return the k-th random number of a sample. */
static uint32_t draw(uint32_t index, uint32_t k)
{
    uint32_t x = index * 0x9E3779B1u + k * 0x85EBCA77u;

    x ^= x >> 16;
    x *= 0x85EBCA6Bu;
    x ^= x >> 13;
    x *= 0xC2B2AE35u;
    return x ^ (x >> 16);
}

/* Return the k-th random number in [0, 1), with 24 bits. */
static fivebar_real part(uint32_t index, uint32_t k)
{
    return (fivebar_real)(draw(index, k) >> 8) * REAL(5.9604644775390625e-08);
}

static fivebar_real between(uint32_t index, uint32_t k, fivebar_real low, fivebar_real high)
{
    return low + (high - low) * part(index, k);
}

static void mix(sample *s, uint32_t bits)
{
    s->sum = (s->sum ^ bits) * 16777619u;
    s->sum ^= s->sum >> 15;
}

static void mix_int(sample *s, int value)
{
    mix(s, (uint32_t)value);
}

static void mix_reals(sample *s, const fivebar_real *values, int count)
{
    int k;

    for (k = 0; k < count; k++) {
#ifdef FIVEBAR_DOUBLE
        uint64_t bits;
        __builtin_memcpy(&bits, values + k, sizeof bits);
        mix(s, (uint32_t)bits);
        mix(s, (uint32_t)(bits >> 32));
#else
        uint32_t bits;
        __builtin_memcpy(&bits, values + k, sizeof bits);
        mix(s, bits);
#endif
    }
}

static void mix_chain(sample *s, const fivebar_chain *chain)
{
    const fivebar_real values[7] = {chain->inner, chain->outer, chain->low,    chain->high,
                                    chain->least, chain->most,  chain->product};

    mix_reals(s, values, 7);
}

/* Every other sample is on a coarse grid, where edges, folds and coaxial legs are hit exactly. */
static fivebar_real length(uint32_t i, uint32_t k, int coarse)
{
    return coarse ? (fivebar_real)(1 + (draw(i, k) & 7)) * REAL(0.015625)
                  : between(i, k, REAL(0.01), REAL(0.1));
}

static fivebar_real place(uint32_t i, uint32_t k, int coarse)
{
    return coarse ? ((fivebar_real)(draw(i, k) % 33) - REAL(16.0)) * REAL(0.015625)
                  : between(i, k, REAL(-0.15), REAL(0.15));
}

static fivebar_real angle(uint32_t i, uint32_t k, int coarse)
{
    return coarse ? ((fivebar_real)(draw(i, k) % 17) - REAL(8.0)) * REAL(0.78539816339744828)
                  : between(i, k, REAL(-4.0), REAL(4.0));
}

static int sign(uint32_t bits)
{
    return bits & 1 ? 1 : -1;
}

static fivebar_leg drawn_leg(uint32_t i, uint32_t odd)
{
    const fivebar_real zero = REAL(0.0);
    uint32_t how = draw(i, 0);
    int coarse = (int)(how & 1);
    fivebar_leg leg = {0};

    leg.L1 = length(i, 1, coarse);
    leg.L2 = length(i, 2, coarse);
    leg.L3 = length(i, 3, coarse);
    leg.L4 = length(i, 4, coarse);
    leg.L5 = (how & 6) == 0 ? zero : length(i, 5, coarse);
    leg.L6 = (how & 8) ? zero : length(i, 6, coarse) * REAL(0.5);
    leg.bend = coarse ? zero : between(i, 7, REAL(-3.14), REAL(3.14));
    leg.tilt = coarse ? zero : between(i, 8, REAL(-3.14), REAL(3.14));
    leg.s_A = sign(how >> 4);
    leg.s_E = sign(how >> 5);
    leg.assembly = sign(how >> 6);
    /* A few that must be refused. */
    leg.L2 = odd == 0 ? (zero / leg.L1) / zero : leg.L2;
    leg.L1 = odd == 1 ? leg.L1 / zero : leg.L1;
    leg.L3 = odd == 2 ? REAL(1e-5) : leg.L3;
    leg.s_A = odd == 3 ? 0 : leg.s_A;
    return leg;
}

static void mix_angles(sample *s, const fivebar_leg *leg, const fivebar_real foot[2], int s_A,
                       int s_E, fivebar_real theta[2])
{
    fivebar_real every[4][2] = {{0}, {0}, {0}, {0}};
    fivebar_real near[2] = {0};
    int each[4] = {0};
    int status = fivebar_inverse(leg, foot, s_A, s_E, every[0]);

    mix_int(s, status);
    mix_reals(s, every[0], 2);
    if (status == FIVEBAR_OK) {
        theta[0] = every[0][0];
        theta[1] = every[0][1];
    }
    every[0][0] = 0;
    every[0][1] = 0;
    mix_int(s, fivebar_inverse_all(leg, foot, every, each));
    for (status = 0; status < 4; status++) {
        mix_int(s, each[status]);
        mix_reals(s, every[status], 2);
    }
    every[0][0] = angle(s->index, 11, 0);
    every[0][1] = angle(s->index, 12, 0);
    mix_int(s, fivebar_inverse_nearest(leg, foot, every[0], near));
    mix_reals(s, near, 2);
    for (status = -1; status < 2; status++) {
        mix_int(s, fivebar_reaches(leg, foot, status));
    }
    near[0] = 0;
    near[1] = 0;
    /* With an extension it takes longer than all else together: every sixteenth will do. */
    if (leg->L6 > 0 && (s->index & 15u) != 0) {
        return;
    }
    mix_int(s, fivebar_nearest(leg, foot, near));
    mix_reals(s, near, 2);
}

static void mix_points(sample *s, const fivebar_leg *leg, const fivebar_real theta[2], int assembly)
{
    fivebar_real foot[2] = {0};
    fivebar_real B[2] = {0};
    fivebar_real D[2] = {0};
    fivebar_real J[2][2] = {{0}, {0}};
    fivebar_real tau[2] = {0};
    fivebar_real force[2];
    fivebar_points points = {{0}, {0}, {0}, {0}};

    mix_int(s, fivebar_forward(leg, theta, assembly, foot));
    mix_reals(s, foot, 2);
    mix_int(s, fivebar_joints(leg, theta, assembly, &points));
    mix_reals(s, points.B, 2);
    mix_reals(s, points.C, 2);
    mix_reals(s, points.D, 2);
    mix_reals(s, points.F, 2);
    mix_int(s, fivebar_knees(leg, theta, B, D));
    mix_reals(s, B, 2);
    mix_reals(s, D, 2);
    mix_int(s, fivebar_jacobian(leg, theta, assembly, J));
    mix_reals(s, J[0], 2);
    mix_reals(s, J[1], 2);
    force[0] = between(s->index, 13, REAL(-9.0), REAL(9.0));
    force[1] = between(s->index, 14, REAL(-9.0), REAL(9.0));
    mix_int(s, fivebar_torque(leg, theta, assembly, force, tau));
    mix_reals(s, tau, 2);
}

static void mix_hip(sample *s, const fivebar_leg *leg, const fivebar_real foot[2], int s_A, int s_E,
                    int assembly)
{
    static const fivebar_hip hips[4] = {
        {FIVEBAR_SIDE_STEP, -1, REAL(0.03), REAL(0.01)},
        {FIVEBAR_STEERING, 1, REAL(0.02), REAL(-0.015)},
        {FIVEBAR_SIDE_STEP, 1, REAL(0.0), REAL(0.0)},
        {FIVEBAR_STEERING, -1, REAL(-0.04), REAL(0.0)},
    };
    const fivebar_hip *hip = hips + (s->index & 3);
    fivebar_real space[3];
    fivebar_real angles[3] = {0};
    fivebar_real back[3] = {0};

    space[0] = foot[0];
    space[1] = place(s->index, 15, 0);
    space[2] = foot[1];
    mix_int(s, fivebar_hip_inverse(leg, hip, space, s_A, s_E, angles));
    mix_reals(s, angles, 3);
    mix_int(s, fivebar_hip_forward(leg, hip, angles, assembly, back));
    mix_reals(s, back, 3);
}

static void mix_servo(sample *s, fivebar_real theta)
{
    static const fivebar_servo servos[4] = {
        {REAL(3.9269908169872414), 1, REAL(0.0), REAL(3.1415926535897931), 0, 180},
        {REAL(1.5707963267948966), -1, REAL(0.0), REAL(3.1415926535897931), 500, 2500},
        {REAL(0.0), 1, REAL(-3.1415926535897931), REAL(3.1415926535897931), 0, 4096},
        {REAL(1.0), 1, REAL(2.0), REAL(1.0), 0, 10},
    };
    const fivebar_servo *servo = servos + (s->index & 3);
    fivebar_real back = 0;
    int32_t command = 0;

    mix_int(s, fivebar_servo_command(servo, theta, &command));
    mix_int(s, (int)command);
    command = (int32_t)(draw(s->index, 16) % 5000u) - 100;
    mix_int(s, fivebar_servo_angle(servo, command, &back));
    mix_reals(s, &back, 1);
}

static void mix_gait(sample *s)
{
    static const fivebar_real rows[5][2] = {{REAL(-2.5), REAL(-0.75)},
                                            {REAL(-2.25), REAL(-0.5)},
                                            {REAL(-2.0), REAL(-0.25)},
                                            {REAL(-2.25), REAL(-0.625)},
                                            {REAL(-2.75), REAL(-0.875)}};
    fivebar_gait gait;
    fivebar_real theta[2] = {0};

    gait.theta = rows;
    gait.rows = 5;
    gait.rate = REAL(50.0);
    gait.periodic = (int)(s->index & 1);
    mix_int(s, fivebar_gait_at(&gait, between(s->index, 17, REAL(-1.5), REAL(1.5)), theta));
    mix_reals(s, theta, 2);
}

static uint32_t bits_of(uint32_t index)
{
    uint32_t odd = draw(index, 30) & 255;
    uint32_t how = draw(index, 0);
    int coarse = (int)(how & 1);
    int assembly = sign(how >> 7);
    int s_A = sign(how >> 8);
    int s_E = odd == 4 ? 0 : sign(how >> 9);
    const fivebar_real zero = REAL(0.0);
    fivebar_leg leg = drawn_leg(index, odd);
    fivebar_real foot[2];
    fivebar_real theta[2];
    sample s = {0};
    int status = fivebar_prepare(&leg);

    s.index = index;
    s.sum = index;
    mix_int(&s, status);
    if (status != FIVEBAR_OK) {
        return s.sum;
    }
    mix_reals(&s, leg.A, 2);
    mix_reals(&s, leg.foot, 2);
    mix_reals(&s, leg.back, 2);
    mix_chain(&s, &leg.to_foot);
    mix_chain(&s, &leg.to_C);
    mix_chain(&s, &leg.knee_knee);
    mix_reals(&s, &leg.apart2, 1);

    foot[0] = odd == 5 ? zero / leg.L5 / zero : odd == 6 ? REAL(1e30) : place(index, 9, coarse);
    foot[1] = place(index, 10, coarse);
    theta[0] = odd == 7 ? leg.L1 / zero : odd == 8 ? REAL(100.0) : angle(index, 18, coarse);
    theta[1] = angle(index, 19, coarse);
    mix_angles(&s, &leg, foot, s_A, s_E, theta);
    mix_points(&s, &leg, theta, assembly);
    mix_hip(&s, &leg, foot, s_A, s_E, assembly);
    mix_servo(&s, theta[0]);
    mix_gait(&s);
    return s.sum;
}

/* Return one number for the bits of `count` samples. */
uint64_t digest(uint32_t first, uint32_t count)
{
    uint32_t plain = 0;
    uint32_t weighted = 0;
    uint32_t i;

    for (i = first; i - first < count; i++) {
        uint32_t bits = bits_of(i);

        plain += bits;
        weighted += bits * (2 * i + 1);
    }
    return ((uint64_t)weighted << 32) | plain;
}
