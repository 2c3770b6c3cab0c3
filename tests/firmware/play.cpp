/* Plays the example sketch for one period, and prints the pulses of each step. */
#include <cstdio>

#include "play_gait.ino"

static unsigned long now = 0;

unsigned long millis(void)
{
    return now;
}

void delay(unsigned long milliseconds)
{
    now += milliseconds;
}

int main()
{
    setup();
    while (now < 1000) {
        loop();
        std::printf("%d %d\n", motor_A.pulse, motor_E.pulse);
    }
    return 0;
}
