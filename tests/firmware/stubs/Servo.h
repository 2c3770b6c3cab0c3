/* Arduino's servos as the example sketch uses them: they keep their last pulse. */
#include <stdint.h>

unsigned long millis(void);
void delay(unsigned long milliseconds);

class Servo
{
  public:
    int pulse;

    void attach(int)
    {
        pulse = 0;
    }
    void writeMicroseconds(int microseconds)
    {
        pulse = microseconds;
    }
};
