/* The firmware speaks the language of `fivebar certify`: one line for each line.
 *
 * cc -I firmware -o certified tests/leg_programs/firmware.c firmware/fivebar_leg.c
 * With -DFIVEBAR_DOUBLE on both files it computes in double.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fivebar_leg.h"

#define MOST 8

static const char *word_of(int status)
{
    switch (status) {
    case FIVEBAR_OK:
        return "ok";
    case FIVEBAR_UNREACHABLE:
        return "unreachable";
    case FIVEBAR_LOOP_OPEN:
        return "open";
    case FIVEBAR_SINGULAR:
        return "singular";
    default:
        return "refused";
    }
}

static int sign_of(fivebar_real x) { return x < 0 ? -1 : 1; }

static void answer(int status, const fivebar_real *numbers, int count)
{
    int k;

    fputs(word_of(status), stdout);
    for (k = 0; status == FIVEBAR_OK && k < count; k++) {
        printf(" %a", (double)numbers[k]);
    }
    putchar('\n');
}

static void take_leg(fivebar_leg *leg, const fivebar_real *x)
{
    leg->L1 = x[0];
    leg->L2 = x[1];
    leg->L3 = x[2];
    leg->L4 = x[3];
    leg->L5 = x[4];
    leg->L6 = x[5];
    leg->bend = x[6];
    leg->tilt = x[7];
    leg->s_A = -1;
    leg->s_E = 1;
    leg->assembly = -1;
    puts(fivebar_prepare(leg) == FIVEBAR_OK ? "ok" : "unsupported");
}

static void reply(fivebar_leg *leg, const char *kind, const fivebar_real *x)
{
    fivebar_real found[4];
    fivebar_real J[2][2];
    int assembly = sign_of(x[0]);
    int status;

    if (strcmp(kind, "fivebar") == 0) {
        puts(sizeof(fivebar_real) == sizeof(float) ? "firmware" : "float64");
    } else if (strcmp(kind, "leg") == 0) {
        take_leg(leg, x);
    } else if (strcmp(kind, "inverse") == 0) {
        answer(fivebar_inverse(leg, x + 2, sign_of(x[0]), sign_of(x[1]), found), found, 2);
    } else if (strcmp(kind, "forward") == 0) {
        answer(fivebar_forward(leg, x + 1, assembly, found), found, 2);
    } else if (strcmp(kind, "knees") == 0) {
        answer(fivebar_knees(leg, x + 1, found, found + 2), found, 4);
    } else if (strcmp(kind, "jacobian") == 0) {
        status = fivebar_jacobian(leg, x + 1, assembly, J);
        if (status == FIVEBAR_OK) {
            memcpy(found, J, sizeof(J));
        }
        answer(status, found, 4);
    } else if (strcmp(kind, "torque") == 0) {
        answer(fivebar_torque(leg, x + 1, assembly, x + 3, found), found, 2);
    } else if (strcmp(kind, "nearest") == 0) {
        answer(fivebar_nearest(leg, x, found), found, 2);
    } else {
        puts("unsupported");
    }
}

int main(void)
{
    static fivebar_leg leg;
    char line[512];

    while (fgets(line, sizeof(line), stdin) != NULL) {
        fivebar_real x[MOST] = {0};
        const char *kind = strtok(line, " \n");
        const char *word;
        int k = 0;

        while (kind != NULL && k < MOST && (word = strtok(NULL, " \n")) != NULL) {
            x[k++] = (fivebar_real)strtod(word, NULL);
        }
        if (kind != NULL) {
            reply(&leg, kind, x);
        }
    }
    return 0;
}
