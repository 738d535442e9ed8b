/* Model of a hobby servo: the length of a pulse, 0.5 to 2.5 ms, sets the angle, to which it turns at a constant speed. */
#include <math.h>

#include <simavr/avr_ioport.h>
#include <simavr/avr_timer.h>
#include <simavr/sim_time.h>

#include "emulator.h"

#define SHORTEST (FREQUENCY / 2000) // cycles
#define LONGEST (FREQUENCY / 400)
#define MIDDLE (3 * FREQUENCY / 2000)
#define CLOCK 8 // cycles of the timer; simavr changes the pin up to a cycle early or late
#define DEGREES_A_CLOCK (90.0 * 1000 * CLOCK / FREQUENCY)
#define MOST 90.0 // degrees on both sides
#define SPEED 400.0 // degrees/s
#define TICK 16000 // cycles between two updates
#define TCCR1A 0x80
#define COM1B0 (1 << 4) // a match sets the pin; otherwise it clears it

static struct {
    avr_cycle_count_t rose;
    double wanted, angle; // degrees
    bool high, turning;
} servo;

double servo_degrees(void) { return servo.angle; }

static avr_cycle_count_t turn(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)avr;
    (void)unused;
    double most = SPEED * TICK / FREQUENCY;
    double way = servo.wanted - servo.angle;
    servo.angle = fabs(way) <= most ? servo.wanted : servo.angle + copysign(most, way);
    servo.turning = servo.angle != servo.wanted;
    return servo.turning ? when + TICK : 0;
}

static bool is_output(avr_t *avr, struct pin pin)
{
    avr_ioport_state_t state;
    avr_ioctl(avr, AVR_IOCTL_IOPORT_GETSTATE(pin.port), &state);
    return state.ddr >> pin.bit & 1;
}

static void pulse_changed(struct avr_irq_t *irq, uint32_t high, void *parameter)
{
    (void)irq;
    avr_t *avr = parameter;
    if (!is_output(avr, options.controller->servo))
        die("the pin of the servo is no output");
    if ((high != 0) != ((avr->data[TCCR1A] & COM1B0) != 0))
        return; // not a match: at an overflow, simavr changes the output as in its PWM modes
    if (servo.high == (high != 0))
        return; // the pin had this level already
    servo.high = high;
    if (high) {
        servo.rose = avr->cycle;
        return;
    }
    avr_cycle_count_t length = avr->cycle - servo.rose;
    if (length < SHORTEST - CLOCK || length > LONGEST + CLOCK)
        die("a pulse of the servo is shorter than 0.5 ms or longer than 2.5 ms");
    double wanted = round(((double)length - MIDDLE) / CLOCK) * DEGREES_A_CLOCK * (miswired(MOTOR_REVERSED) ? -1 : 1);
    if (miswired(MOTOR_OPEN) || wanted == servo.wanted)
        return;
    if (ranging_listens())
        die("the firmware turns the servo while it listens");
    servo.wanted = wanted;
    if (!servo.turning)
        avr_cycle_timer_register(avr, TICK, turn, NULL);
    servo.turning = true;
}

void servo_start(avr_t *avr, double degrees)
{
    servo.angle = servo.wanted = fmax(-MOST, fmin(MOST, degrees));
    // not at the pin: simavr takes the pin back to its port whenever another pin of the port changes
    avr_irq_t *output = avr_io_getirq(avr, AVR_IOCTL_TIMER_GETIRQ('1'), TIMER_IRQ_OUT_COMP + AVR_TIMER_COMPB);
    avr_irq_register_notify(output, pulse_changed, avr);
}
