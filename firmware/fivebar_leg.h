/* The kinematics of a closed five-bar leg for a microcontroller: C99, also C++ and Arduino.
 *
 *   A ---- L5 ---- E     A, E driven; theta_A, theta_E anticlockwise from +x of the hip frame to +z
 *    \            /      B, D passive knees; C closes the loop
 *     L1        L4       L6: rigid extension of L2 beyond C, turned by bend, ending in the foot F
 *      B        D        the origin is midway between A and E, x forward, z up;
 *       L2    L3         AE is turned by tilt
 *         \  /
 *          C
 *
 * Metres, radians, newtons. Every function returns a status: FIVEBAR_OK or why there is no answer,
 * and it writes its results only with FIVEBAR_OK. No allocation, no variables outside functions, no
 * libm, no memory of earlier poses.
 *
 * The same bits everywhere: + - * / and sqrt are exact to IEEE 754, and the angles come from fixed
 * polynomials in a fixed order, so that all processors, WebAssembly and `fivebar_sim.firmware` in
 * NumPy agree to the last bit. That needs a compiler that keeps to IEEE: no -ffast-math, and no
 * fused multiply-add (the source switches both off where it can and refuses to compile where not).
 */
#ifndef FIVEBAR_LEG_H
#define FIVEBAR_LEG_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* float unless all files are compiled with -DFIVEBAR_DOUBLE. */
#ifdef FIVEBAR_DOUBLE
typedef double fivebar_real;
#else
typedef float fivebar_real;
#endif

/* Statuses. */
enum {
    FIVEBAR_OK = 0,
    FIVEBAR_UNREACHABLE = 1,   /* a side chain, or the hip, does not reach the foot */
    FIVEBAR_LOOP_OPEN = 2,     /* L2 and L3 do not meet at these angles, or B is on D */
    FIVEBAR_OUT_OF_LIMITS = 3, /* an angle, a count or a phase is outside its range */
    FIVEBAR_NOT_FINITE = 4,    /* an argument is NaN or infinite */
    FIVEBAR_SINGULAR = 5,      /* B, C and D are in line: no Jacobian */
    FIVEBAR_BAD_ARGUMENT = 6,  /* a mode, an assembly, a side or a direction other than -1 or +1 */
    FIVEBAR_BAD_LEG = 7        /* lengths that no leg has, or that this arithmetic cannot hold */
};

/* Largest motor angle that is taken [rad]: ten turns. Beyond, a float's steps are too coarse. */
#define FIVEBAR_LARGEST_ANGLE 64

/* How far the end of a chain of two links may be from its start: derived, see fivebar_prepare. */
typedef struct {
    fivebar_real inner;   /* |near - far| [m] */
    fivebar_real outer;   /* near + far [m] */
    fivebar_real low;     /* inner^2 [m^2] */
    fivebar_real high;    /* outer^2 [m^2] */
    fivebar_real least;   /* square of inner less the slack for rounding [m^2]; 0: no hole */
    fivebar_real most;    /* square of outer and the slack [m^2] */
    fivebar_real product; /* (near - far) (near + far) [m^2] */
} fivebar_chain;

/* A leg. Fill in the first part and call fivebar_prepare once; or export a const one. */
typedef struct {
    fivebar_real L1; /* |AB| [m] */
    fivebar_real L2; /* |BC| [m] */
    fivebar_real L3; /* |DC| [m] */
    fivebar_real L4; /* |ED| [m] */
    fivebar_real L5; /* |AE| [m]; 0 is coaxial */
    fivebar_real L6; /* |CF| [m]; 0: the foot is C */
    fivebar_real bend; /* angle of CF from the direction of BC [rad], in [-pi, pi] */
    fivebar_real tilt; /* angle of AE from +x [rad], in [-pi, pi] */
    int s_A;           /* working mode of side A, -1 or +1: the sign of AF x AB */
    int s_E;           /* working mode of side E, -1 or +1: the sign of EC x ED */
    int assembly;      /* -1 or +1: the sign of BD x BC */

    /* Derived by fivebar_prepare. */
    fivebar_real A[2];       /* motor axis A [m]; E is its mirror image -A */
    fivebar_real foot[2];    /* BF = foot BC, as complex numbers */
    fivebar_real back[2];    /* BC = back BF, as complex numbers */
    fivebar_chain to_foot;   /* A, B, F */
    fivebar_chain to_C;      /* E, D, C */
    fivebar_chain knee_knee; /* B, C, D */
    fivebar_real apart2;     /* |BD|^2 up to which B counts as on D [m^2] */
} fivebar_leg;

/* The exported leg. */
extern const fivebar_leg FIVEBAR_LEG;

/* Compute the derived part of a leg from its first part.
 * Lengths must make a leg, with the longest of all chains from 0.1 mm to 1 km, and no link and no
 * |BF| shorter than a thousandth of it. FIVEBAR_NOT_FINITE, _BAD_ARGUMENT, _BAD_LEG. */
int fivebar_prepare(fivebar_leg *leg);

/* The motor angles [rad], in (-pi, pi], that put the foot [m] in a working mode (s_A, s_E). A chain
 * that ends on its motor fits at any angle; 0 by convention. FIVEBAR_NOT_FINITE, _BAD_ARGUMENT,
 * _UNREACHABLE. */
int fivebar_inverse(const fivebar_leg *leg, const fivebar_real foot[2], int s_A, int s_E,
                    fivebar_real theta[2]);

/* All four working modes, in the order (-,-) (-,+) (+,-) (+,+), with the status of each; rows of
 * modes that do not reach stay as they were. FIVEBAR_OK if any mode reaches, else the status of the
 * leg's own. */
int fivebar_inverse_all(const fivebar_leg *leg, const fivebar_real foot[2],
                        fivebar_real theta[4][2], int status[4]);

/* The one of the four that is nearest to the present angles, each difference within half a turn; it
 * is continuous with them, so it may leave (-pi, pi]. Of equally near ones the first. */
int fivebar_inverse_nearest(const fivebar_leg *leg, const fivebar_real foot[2],
                            const fivebar_real now[2], fivebar_real theta[2]);

/* The foot [m] at motor angles, in an assembly mode. FIVEBAR_NOT_FINITE, _OUT_OF_LIMITS (beyond
 * FIVEBAR_LARGEST_ANGLE), _BAD_ARGUMENT, _LOOP_OPEN. */
int fivebar_forward(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                    fivebar_real foot[2]);

/* The knees B and D [m]; they need no closed loop. */
int fivebar_knees(const fivebar_leg *leg, const fivebar_real theta[2], fivebar_real B[2],
                  fivebar_real D[2]);

/* All joints of a closed pose [m], as fivebar_forward finds them. */
typedef struct {
    fivebar_real B[2];
    fivebar_real C[2];
    fivebar_real D[2];
    fivebar_real F[2];
} fivebar_points;
int fivebar_joints(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                   fivebar_points *points);

/* J[i][j] = d foot[i] / d theta[j] [m/rad]. As fivebar_forward, and FIVEBAR_SINGULAR. */
int fivebar_jacobian(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                     fivebar_real J[2][2]);

/* The motor torques [N m] that hold a force of the world on the foot [N] at rest, links without
 * weight: tau = -J^T force. As fivebar_jacobian. */
int fivebar_torque(const fivebar_leg *leg, const fivebar_real theta[2], int assembly,
                   const fivebar_real force[2], fivebar_real tau[2]);

/* Whether the foot can be put there: FIVEBAR_OK or _UNREACHABLE, _NOT_FINITE, _BAD_ARGUMENT.
 * s_A = 0 asks for any working mode; s_E does not matter to the reach. */
int fivebar_reaches(const fivebar_leg *leg, const fivebar_real foot[2], int s_A);

/* The reachable point that is nearest to a point [m]; a reachable one is returned as it is. What it
 * returns is reached in at least one working mode. Its distance to the point is the least one to
 * 1e-6 of the leg's size and L5. Without an extension that takes some square roots; with one (L6 > 0)
 * up to four coupler curves are walked along, in 150 to 300 steps of about 100 operations. Where A, B,
 * C and E can lie in one line, two of the curves' branches cross, and of a point whose nearest one is
 * just there the distance may be more by 1e-3. FIVEBAR_OUT_OF_LIMITS beyond 10^6 m,
 * FIVEBAR_UNREACHABLE if the leg reaches nothing at all. */
int fivebar_nearest(const fivebar_leg *leg, const fivebar_real foot[2], fivebar_real nearest[2]);

/* A third motor that turns the leg plane. Body frame: origin on the hip's axis, x forward, y left,
 * z up; at phi = 0 the leg plane is parallel to x-z, and the leg's origin is at
 *     side-step   about x:  (0, across, along)
 *     steering    about z:  (along, across, 0) */
enum { FIVEBAR_SIDE_STEP = 0, FIVEBAR_STEERING = 1 };
typedef struct {
    int kind;            /* FIVEBAR_SIDE_STEP or FIVEBAR_STEERING */
    int side;            /* side-step: -1 foot below the axis; steering: +1 foot in front of it */
    fivebar_real across; /* of the leg plane from the axis [m] */
    fivebar_real along;  /* of the leg's origin within the plane [m] */
} fivebar_hip;

/* (phi, theta_A, theta_E) [rad] that put the foot (x, y, z) [m]. As fivebar_inverse; also
 * FIVEBAR_UNREACHABLE within |across| of the axis. */
int fivebar_hip_inverse(const fivebar_leg *leg, const fivebar_hip *hip, const fivebar_real foot[3],
                        int s_A, int s_E, fivebar_real angles[3]);

/* The foot (x, y, z) [m] at (phi, theta_A, theta_E). As fivebar_forward. */
int fivebar_hip_forward(const fivebar_leg *leg, const fivebar_hip *hip,
                        const fivebar_real angles[3], int assembly, fivebar_real foot[3]);

/* A servo takes commands first .. last (counts, microseconds, degrees), at equal steps of angle:
 *     angle = offset + direction theta, plus whole turns, in [low, high] (at most a turn wide)
 *     command = first + (angle - low) (last - first) / (high - low), to the nearest, half up */
typedef struct {
    fivebar_real offset; /* angle of the servo at theta = 0 [rad] */
    int direction;       /* +1 if it grows with theta, -1 if the servo is mounted mirrored */
    fivebar_real low;    /* least angle of the servo [rad] */
    fivebar_real high;   /* greatest [rad] */
    int32_t first;       /* command at low */
    int32_t last;        /* command at high, above first by at most 10^6 */
} fivebar_servo;

/* The command of a motor angle. FIVEBAR_OUT_OF_LIMITS outside [low, high], _BAD_ARGUMENT for a
 * servo whose limits cross. */
int fivebar_servo_command(const fivebar_servo *servo, fivebar_real theta, int32_t *command);

/* The motor angle [rad] of a command, in (-pi, pi]. FIVEBAR_OUT_OF_LIMITS outside first .. last. */
int fivebar_servo_angle(const fivebar_servo *servo, int32_t command, fivebar_real *theta);

/* Setpoints at equal steps of time: `rows` pairs (theta_A, theta_E) [rad]. A periodic table has one
 * period; row 0 comes again after its last. */
typedef struct {
    const fivebar_real (*theta)[2];
    int32_t rows;      /* at least 2 */
    fivebar_real rate; /* rows a second [Hz] */
    int periodic;      /* 1, or 0: the table ends with its last row */
} fivebar_gait;

/* The setpoints at a phase, linear between rows. Phase 1 is a whole period: any finite phase of a
 * periodic table, or 0 (first row) to 1 (last row). FIVEBAR_OUT_OF_LIMITS for another, or beyond
 * 10^6 periods; FIVEBAR_BAD_ARGUMENT for fewer than two rows. */
int fivebar_gait_at(const fivebar_gait *gait, fivebar_real phase, fivebar_real theta[2]);

#ifdef __cplusplus
}
#endif

#endif
