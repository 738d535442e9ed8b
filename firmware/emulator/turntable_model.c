/* Model of the turntable: motor, gear with backlash, mark and cam.
 *
 * The magnetic field pulls the rotor like a spring. The rotor oscillates around its position, and slips by whole
 * periods of the field (64 microsteps) if it cannot follow.
 */
#include <math.h>

#include "emulator.h"

#define MICROSTEPS 7200.0 // per turn
#define FIELD 64.0 // microsteps per period of the field
#define SWING 60.0 // Hz, oscillation of rotor and table
#define DAMPING 0.35 // relative to critical damping
#define PLAY 12.0 // backlash of the gear, microsteps
#define CAM (-20.0 / 360 * MICROSTEPS) // position of its edge
#define MARK -1.0 // position of its edge; chosen so that zero is at 0, because the rotor lags while creeping
#define TICK 1600 // cycles between two updates

static struct {
    bool forwards, powered;
    double field, rotor, speed, table; // microsteps and microsteps/s
    double field_before; // a tick ago
    bool swinging;
    avr_cycle_count_t free_again;
} motor;

double turntable_degrees(void)
{
    // after the oscillation it is within a fraction of a microstep
    return round(motor.table) / MICROSTEPS * 360;
}

void turntable_show(avr_t *avr)
{
    double turn = (motor.table - MARK) / MICROSTEPS;
    // an open wire is high, because of its pull-up
    set_pin(avr, 'A', 3, (turn - floor(turn) < 0.5) != miswired(MARK_INVERTED) || miswired(MARK_OPEN));
    set_pin(avr, 'A', 4, (motor.table > CAM) != miswired(CAM_INVERTED) || miswired(CAM_OPEN));
}

static void move_rotor(double seconds)
{
    double angular = 2 * M_PI * SWING;
    double strength = angular * angular * FIELD / (2 * M_PI);
    double pull = motor.powered ? -strength * sin(2 * M_PI * (motor.rotor - motor.field) / FIELD) : 0;
    // damping acts on the speed of the rotor relative to the field
    double swing = motor.speed - (motor.powered ? (motor.field - motor.field_before) / seconds : 0);
    motor.field_before = motor.field;
    motor.speed += (pull - 2 * DAMPING * angular * swing) * seconds;
    motor.rotor += motor.speed * seconds;
    if (motor.table < motor.rotor - PLAY)
        motor.table = motor.rotor - PLAY;
    if (motor.table > motor.rotor)
        motor.table = motor.rotor;
}

static avr_cycle_count_t update(avr_t *avr, avr_cycle_count_t when, void *unused)
{
    (void)unused;
    if (when < motor.free_again) {
        motor.speed = 0;
        motor.field_before = motor.field; // the field moves on without the rotor
    } else {
        move_rotor((double)TICK / FREQUENCY);
    }
    turntable_show(avr);
    double away = fabs(remainder(motor.rotor - motor.field, FIELD));
    motor.swinging = motor.powered && (fabs(motor.speed) > 0.5 || away > 0.01 || when < motor.free_again);
    return motor.swinging ? when + TICK : 0;
}

static void start_updates(avr_t *avr)
{
    if (motor.swinging)
        return;
    motor.swinging = true;
    avr_cycle_timer_register(avr, TICK, update, NULL);
}

static void step_changed(avr_t *avr, bool high)
{
    if (!high || !motor.powered || miswired(MOTOR_OPEN))
        return;
    if (ranging_listens())
        die("the firmware steps while it listens");
    motor.field += motor.forwards != miswired(MOTOR_REVERSED) ? 1 : -1;
    start_updates(avr);
}

static void direction_changed(avr_t *avr, bool high)
{
    (void)avr;
    motor.forwards = high;
}

static void enable_changed(avr_t *avr, bool high)
{
    motor.powered = !high;
    // without current the driver still counts steps; with current the rotor moves to the nearest stable position
    if (motor.powered)
        start_updates(avr);
}

void turntable_reset(avr_t *avr)
{
    motor.free_again = 0;
    motor.swinging = false;
    start_updates(avr);
}

void turntable_slip(double microsteps)
{
    motor.rotor -= microsteps;
    motor.field -= microsteps;
    motor.field_before -= microsteps;
}

void turntable_wedge(avr_t *avr, double duration)
{
    motor.free_again = avr->cycle + (avr_cycle_count_t)(duration * FREQUENCY);
    start_updates(avr);
}

void turntable_start(avr_t *avr, double degrees)
{
    motor.rotor = motor.field = motor.field_before = round(degrees / 360 * MICROSTEPS);
    motor.table = motor.rotor - PLAY;
    make_irq_listener(avr, 'A', 0, step_changed);
    make_irq_listener(avr, 'A', 1, direction_changed);
    make_irq_listener(avr, 'A', 2, enable_changed);
    turntable_show(avr);
}
