/* Model of the turntable: stepper on a driver or on four pins, gear with backlash, mark and cam.
 *
 * The magnetic field pulls the rotor like a spring. The rotor oscillates around its position, and slips by whole
 * periods of the field (64 microsteps) if it cannot follow.
 */
#include <math.h>

#include "emulator.h"

#define SWING 60.0 // Hz, oscillation of rotor and table
#define DAMPING 0.35 // relative to critical damping
#define CAM (-20.0 / 360 * kind->steps) // position of its edge
#define MARK -1.0 // position of its edge; chosen so that zero is at 0, because the rotor lags while creeping
#define TICK 1600 // cycles between two updates

struct kind {
    double steps; // per turn: microsteps, or half steps of a 28BYJ-48
    double field; // steps per period of the field
    double play; // backlash of the gear, steps
};

static const struct kind with_driver = {7200, 64, 12}, with_coils = {4096, 8, 30};
static const struct kind *kind = &with_driver;

static struct {
    bool forwards, powered;
    double field, rotor, speed, table; // steps and steps/s
    double field_before; // a tick ago
    bool swinging;
    avr_cycle_count_t free_again;
} motor;

double turntable_degrees(void)
{
    if (options.turning == SERVO)
        return servo_degrees();
    // after the oscillation it is within a fraction of a step
    return round(motor.table) / kind->steps * 360;
}

void turntable_show(avr_t *avr)
{
    if (options.turning != STEP_DIR)
        return;
    double turn = (motor.table - MARK) / kind->steps;
    // an open wire is high, because of its pull-up
    set_pin(avr, options.controller->mark, (turn - floor(turn) < 0.5) != miswired(MARK_INVERTED) || miswired(MARK_OPEN));
    set_pin(avr, options.controller->cam, (motor.table > CAM) != miswired(CAM_INVERTED) || miswired(CAM_OPEN));
}

static void move_rotor(double seconds)
{
    double angular = 2 * M_PI * SWING;
    double strength = angular * angular * kind->field / (2 * M_PI);
    double pull = motor.powered ? -strength * sin(2 * M_PI * (motor.rotor - motor.field) / kind->field) : 0;
    // damping acts on the speed of the rotor relative to the field
    double swing = motor.speed - (motor.powered ? (motor.field - motor.field_before) / seconds : 0);
    motor.field_before = motor.field;
    motor.speed += (pull - 2 * DAMPING * angular * swing) * seconds;
    motor.rotor += motor.speed * seconds;
    if (motor.table < motor.rotor - kind->play)
        motor.table = motor.rotor - kind->play;
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
    double away = fabs(remainder(motor.rotor - motor.field, kind->field));
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
    double step = miswired(STEPS_DOUBLED) ? 2 : 1; // a jumper of the driver
    motor.field += motor.forwards != miswired(MOTOR_REVERSED) ? step : -step;
    start_updates(avr);
}

static void coils_changed(avr_t *avr, int coil, bool high)
{
    static const uint8_t halves[8] = {1, 3, 2, 6, 4, 12, 8, 9}; // coils that carry current
    static uint8_t coils;
    static int phase;
    coils = (uint8_t)((coils & ~(1 << coil)) | high << coil);
    motor.powered = coils != 0 && !miswired(MOTOR_OPEN);
    for (int now = 0; now < 8; now++) {
        if (coils != halves[now])
            continue;
        if (now != phase && ranging_listens())
            die("the firmware steps while it listens");
        // the nearest position of the field with this phase
        motor.field += ((now - phase + 12) % 8 - 4) * (miswired(MOTOR_REVERSED) ? -1 : 1);
        phase = now;
    }
    if (motor.powered)
        start_updates(avr);
}

static void coil_1_changed(avr_t *avr, bool high) { coils_changed(avr, 0, high); }

static void coil_2_changed(avr_t *avr, bool high) { coils_changed(avr, 1, high); }

static void coil_3_changed(avr_t *avr, bool high) { coils_changed(avr, 2, high); }

static void coil_4_changed(avr_t *avr, bool high) { coils_changed(avr, 3, high); }

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
    if (options.turning == SERVO)
        return;
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
    const struct controller *pins = options.controller;
    if (options.turning == SERVO) {
        servo_start(avr, degrees);
        return;
    }
    kind = options.turning == FOUR_COILS ? &with_coils : &with_driver;
    motor.rotor = motor.field = motor.field_before = round(degrees / 360 * kind->steps);
    motor.table = motor.rotor - kind->play;
    if (options.turning == FOUR_COILS) {
        listen_to_pin(avr, pins->coils[0], coil_1_changed);
        listen_to_pin(avr, pins->coils[1], coil_2_changed);
        listen_to_pin(avr, pins->coils[2], coil_3_changed);
        listen_to_pin(avr, pins->coils[3], coil_4_changed);
        return;
    }
    listen_to_pin(avr, pins->step, step_changed);
    listen_to_pin(avr, pins->direction, direction_changed);
    listen_to_pin(avr, pins->enable, enable_changed);
    turntable_show(avr);
}
