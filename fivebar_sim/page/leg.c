/* The firmware's leg for a web page: its functions over one block of numbers, for WebAssembly.
 *
 * scripts/build_wasm.py compiles it to leg.wasm; leg.js reads and writes the numbers. Nothing is
 * computed here that firmware/fivebar_leg.c can compute.
 */
#include "fivebar_leg.c"

#define EXPORT(name) __attribute__((export_name(#name)))

/* Side of the largest map. */
#define MOST 256

enum {
    LENGTHS = 0,  /* L1 .. L6 [m], bend, tilt [rad] */
    SIGNS = 8,    /* s_A, s_E */
    FOOT = 10,    /* x, z [m] */
    FORCE = 12,   /* of the world on the foot, x, z [N] */
    THETA = 14,   /* of A and E [rad] */
    JOINTS = 16,  /* B, C, D, F [m] */
    SLOPES = 24,  /* Jacobian, by rows [m/rad] */
    TORQUE = 28,  /* of A and E [N m] */
    NEAREST = 30, /* x, z [m] */
    SIDE = 32,    /* assembly mode */
    COUNT = 33
};

static float numbers[COUNT];
static float map[MOST * MOST];
static fivebar_leg leg;

EXPORT(numbers) float *page_numbers(void) { return numbers; }

EXPORT(map) float *page_map(void) { return map; }

/* Take the lengths and signs; the status of fivebar_prepare. */
EXPORT(prepare) int page_prepare(void)
{
    leg.L1 = numbers[LENGTHS];
    leg.L2 = numbers[LENGTHS + 1];
    leg.L3 = numbers[LENGTHS + 2];
    leg.L4 = numbers[LENGTHS + 3];
    leg.L5 = numbers[LENGTHS + 4];
    leg.L6 = numbers[LENGTHS + 5];
    leg.bend = numbers[LENGTHS + 6];
    leg.tilt = numbers[LENGTHS + 7];
    leg.s_A = numbers[SIGNS] < 0.0f ? -1 : 1;
    leg.s_E = numbers[SIGNS + 1] < 0.0f ? -1 : 1;
    leg.assembly = -1;
    return fivebar_prepare(&leg);
}

/* The joints of angles that put the foot there, and their assembly mode: the sign of BD x BC. They
 * are known also where the angles alone do not tell them: with B on D. */
static int joints_of(const float theta[2], const float foot[2], fivebar_points *p)
{
    float BF[2];
    float BC[2];
    float BD[2];
    int k;

    if (fivebar_knees(&leg, theta, p->B, p->D) != FIVEBAR_OK) {
        return -1;
    }
    for (k = 0; k < 2; k++) {
        BF[k] = foot[k] - p->B[k];
        BD[k] = p->D[k] - p->B[k];
    }
    multiply(leg.back, BF, BC);
    for (k = 0; k < 2; k++) {
        p->C[k] = p->B[k] + BC[k];
        p->F[k] = foot[k];
    }
    return cross(BD, BC) < 0.0f ? -1 : 1;
}

static void show(const fivebar_points *points, int assembly)
{
    int k;

    for (k = 0; k < 2; k++) {
        numbers[JOINTS + k] = points->B[k];
        numbers[JOINTS + 2 + k] = points->C[k];
        numbers[JOINTS + 4 + k] = points->D[k];
        numbers[JOINTS + 6 + k] = points->F[k];
    }
    numbers[SIDE] = (float)assembly;
}

/* Everything at the angles: joints, and where there are any Jacobian and torque. */
static int closed(int assembly)
{
    fivebar_points points;
    int status = fivebar_joints(&leg, &numbers[THETA], assembly, &points);

    if (status != FIVEBAR_OK) {
        return status;
    }
    show(&points, assembly);
    status = fivebar_jacobian(&leg, &numbers[THETA], assembly,
                              (fivebar_real(*)[2])(void *)&numbers[SLOPES]);
    if (status != FIVEBAR_OK) {
        return status;
    }
    return fivebar_torque(&leg, &numbers[THETA], assembly, &numbers[FORCE], &numbers[TORQUE]);
}

/* Angles, joints, Jacobian and torques of the foot's place. */
EXPORT(inverse) int page_inverse(void)
{
    fivebar_points points;
    int assembly;
    int status = fivebar_inverse(&leg, &numbers[FOOT], leg.s_A, leg.s_E, &numbers[THETA]);

    if (status != FIVEBAR_OK) {
        return status;
    }
    assembly = joints_of(&numbers[THETA], &numbers[FOOT], &points);
    show(&points, assembly);
    return closed(assembly);
}

/* The same of the angles, in an assembly mode. */
EXPORT(forward) int page_forward(int assembly) { return closed(assembly); }

EXPORT(nearest) int page_nearest(void)
{
    return fivebar_nearest(&leg, &numbers[FOOT], &numbers[NEAREST]);
}

/* The larger torque [N m] for the force at points of a grid of some columns, from (x, z) on in steps;
 * -1 out of reach, infinite where singular. Row by row, `count` points from the `first`. */
EXPORT(survey)
void page_survey(float x, float z, float step, int columns, int first, int count)
{
    int k;

    for (k = first; k < first + count && k < MOST * MOST; k++) {
        float foot[2];
        float theta[2];
        float tau[2];
        fivebar_points points;
        int status;

        foot[0] = x + step * (float)(k % columns);
        foot[1] = z + step * (float)(k / columns);
        map[k] = -1.0f;
        if (fivebar_inverse(&leg, foot, leg.s_A, leg.s_E, theta) != FIVEBAR_OK) {
            continue;
        }
        status = fivebar_torque(&leg, theta, joints_of(theta, foot, &points), &numbers[FORCE], tau);
        if (status != FIVEBAR_OK) {
            map[k] = __builtin_inff();
            continue;
        }
        tau[0] = magnitude(tau[0]);
        tau[1] = magnitude(tau[1]);
        map[k] = tau[0] > tau[1] ? tau[0] : tau[1];
    }
}
