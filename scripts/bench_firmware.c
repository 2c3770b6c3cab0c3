/* Nanoseconds per inverse: the firmware's own functions, and the same formulas through libm.
 *
 * Both are compiled in one file with the same flags, and timed in turn. */
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "fivebar_leg.c"

#define POINTS 4096
#define ROUNDS 200
#define TRIES 15

/* As fivebar_inverse, with sqrtf and atan2f of libm. */
static int crank_by_libm(const fivebar_chain *chain, const float r[2], int s, float *theta)
{
    float square = r[0] * r[0] + r[1] * r[1];
    float n = square + chain->product;
    float p = (chain->high - square) * (square - chain->low);
    float root;

    if (!(square >= chain->least && square <= chain->most)) {
        return FIVEBAR_UNREACHABLE;
    }
    root = (float)s * sqrtf(p > 0.0f ? p : 0.0f);
    *theta = atan2f(r[1] * n + r[0] * root, r[0] * n - r[1] * root);
    return FIVEBAR_OK;
}

static int inverse_by_libm(const fivebar_leg *leg, const float foot[2], int s_A, int s_E,
                           float theta[2])
{
    const float AF[2] = {foot[0] - leg->A[0], foot[1] - leg->A[1]};
    const float EF[2] = {foot[0] + leg->A[0], foot[1] + leg->A[1]};
    float A;
    float E;

    if (!isfinite(foot[0]) || !isfinite(foot[1])) {
        return FIVEBAR_NOT_FINITE;
    }
    if (crank_by_libm(&leg->to_foot, AF, s_A, &A) || crank_by_libm(&leg->to_C, EF, s_E, &E)) {
        return FIVEBAR_UNREACHABLE;
    }
    theta[0] = A;
    theta[1] = E;
    return FIVEBAR_OK;
}

typedef int inverse(const fivebar_leg *leg, const float foot[2], int s_A, int s_E, float theta[2]);

static double seconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Return the nanoseconds of one inverse, on points all over the leg's workspace. */
static double timed(inverse *function, float feet[POINTS][2], float *sum)
{
    double start = seconds();
    int round;
    int k;

    for (round = 0; round < ROUNDS; round++) {
        for (k = 0; k < POINTS; k++) {
            float theta[2] = {0.0f, 0.0f};

            if (function(&FIVEBAR_LEG, feet[k], -1, 1, theta) == FIVEBAR_OK) {
                *sum += theta[0] + theta[1];
            }
        }
    }
    return 1e9 * (seconds() - start) / ((double)POINTS * ROUNDS);
}

int main(void)
{
    static float feet[POINTS][2];
    inverse *volatile ours = fivebar_inverse;
    inverse *volatile libm = inverse_by_libm;
    double least_ours = 1e9;
    double least_libm = 1e9;
    uint32_t random = 1;
    float sum = 0.0f;
    int count = 0;
    int k;

    while (count < POINTS) {
        random = random * 1664525u + 1013904223u;
        feet[count][0] = 0.2f * ((float)(random >> 8) / 16777216.0f - 0.5f);
        random = random * 1664525u + 1013904223u;
        feet[count][1] = 0.2f * ((float)(random >> 8) / 16777216.0f - 0.5f);
        count += fivebar_reaches(&FIVEBAR_LEG, feet[count], 0) == FIVEBAR_OK;
    }
    for (k = 0; k < TRIES; k++) {
        double one = timed(ours, feet, &sum);
        double other = timed(libm, feet, &sum);

        least_ours = one < least_ours ? one : least_ours;
        least_libm = other < least_libm ? other : least_libm;
    }
    printf("%.2f %.2f %g\n", least_ours, least_libm, (double)sum);
    return 0;
}
