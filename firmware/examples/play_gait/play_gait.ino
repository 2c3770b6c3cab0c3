/* Plays a gait on two hobby servos, at pins 9 (motor A) and 10 (motor E). */
#include <Servo.h>
#include <fivebar_leg.h>

#include "gait.h"

static Servo motor_A;
static Servo motor_E;

/* Send an angle to a servo; without an answer it stays where it is. */
static void send(Servo &motor, const fivebar_servo *servo, fivebar_real theta)
{
    int32_t microseconds;

    if (fivebar_servo_command(servo, theta, &microseconds) == FIVEBAR_OK) {
        motor.writeMicroseconds((int)microseconds);
    }
}

void setup()
{
    motor_A.attach(9);
    motor_E.attach(10);
}

void loop()
{
    /* One period a second; the table is interpolated between its rows. */
    fivebar_real period = (fivebar_real)GAIT.rows / GAIT.rate;
    unsigned long span = (unsigned long)(period * 1000);
    fivebar_real phase = (fivebar_real)(millis() % span) / (fivebar_real)span;
    fivebar_real theta[2];

    if (fivebar_gait_at(&GAIT, phase, theta) == FIVEBAR_OK) {
        send(motor_A, &SERVO_A, theta[0]);
        send(motor_E, &SERVO_E, theta[1]);
    }
    delay(20);
}
