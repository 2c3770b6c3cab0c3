/* Exits with 0 if the exported leg is what fivebar_prepare makes of its first part. */
#include <string.h>

#include "fivebar_leg.h"

int main(void)
{
    fivebar_leg leg;

    memset(&leg, 0, sizeof leg);
    leg.L1 = FIVEBAR_LEG.L1;
    leg.L2 = FIVEBAR_LEG.L2;
    leg.L3 = FIVEBAR_LEG.L3;
    leg.L4 = FIVEBAR_LEG.L4;
    leg.L5 = FIVEBAR_LEG.L5;
    leg.L6 = FIVEBAR_LEG.L6;
    leg.bend = FIVEBAR_LEG.bend;
    leg.tilt = FIVEBAR_LEG.tilt;
    leg.s_A = FIVEBAR_LEG.s_A;
    leg.s_E = FIVEBAR_LEG.s_E;
    leg.assembly = FIVEBAR_LEG.assembly;
    return fivebar_prepare(&leg) != FIVEBAR_OK || memcmp(&leg, &FIVEBAR_LEG, sizeof leg) != 0;
}
