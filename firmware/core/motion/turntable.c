#include "turntable.h"

#include "board_facts.h" // MICROSTEPS, REACH_DEGREES, speeds
#include "hardware.h" // motor, home switch
#include "homing_facts.h" // JOG_DEGREES
#include "messages.h" // enum approach
#include "ramp.h" // struct ramp

#define TURN_MICRODEGREES 360000000
#define FULL_TRAVEL_US 1000000 // of a servo, whose angle is unknown before its first pulse
#define WIRING_PROVEN 0x40 // stored beside enum wiring: a Home has succeeded with this wiring
#define STEPS_OF_DEGREES(degrees) ((int32_t)((int64_t)(degrees) * MICROSTEPS / 360))

enum leg {
    STILL,
    SEEKING_ABOVE, // counter-clockwise until the cam reports: above zero
    SEEKING_BELOW, // clockwise until the cam reports: below zero
    CREEPING, // counter-clockwise to the mark
    PASSING, // past the heading, to return to it
    APPROACHING, // to the heading
    RETURNING, // to the zero of a servo
    HALTING,
    SETTLING,
};

enum order { NOTHING, TO_HOME, TO_TURN };

static struct {
    enum leg leg;
    enum order order; // starts as soon as the table is at rest
    enum turntable_trouble trouble;
    enum zero zero;
    bool homed_before; // a Home has succeeded since the start
    uint8_t wiring; // enum wiring and WIRING_PROVEN
    bool was_high; // level of the mark while seeking the cam
    bool mark_changed; // in this Home
    int32_t changed_at; // where this level changed last, steps
    int32_t target; // steps
    int32_t awaited; // next expected position of the mark, steps
    int32_t lost; // steps
    uint64_t settled_us;
    struct turntable_manner manner;
} table;

// shared with the step interrupt
static struct ramp ramp;
static bool mark_inverted;
static volatile int32_t position; // steps; before the first zero from the start of the board
static int8_t direction;
static bool was_marked;
static volatile bool mark_passed; // counter-clockwise; only this edge is exact
static volatile int32_t mark_position;

static bool marked_now(void) { return home_mark() != mark_inverted; }

static bool above_zero(void) { return home_side() != ((table.wiring & WIRING_CAM) != 0); }

uint16_t turntable_step(void)
{
    position += direction;
    bool marked = marked_now();
    if (marked && !was_marked && direction > 0) {
        mark_position = position;
        mark_passed = true;
    }
    was_marked = marked;
    return ramp_next(&ramp);
}

static int32_t position_now(void)
{
    interrupts_off();
    int32_t steps = position;
    interrupts_on();
    return steps;
}

void turntable_reset(void)
{
    table.leg = STILL;
    table.trouble = TROUBLE_NONE;
    table.order = NOTHING;
    table.zero = ZERO_UNKNOWN;
    table.homed_before = false;
    table.wiring = stored_wiring();
    mark_inverted = table.wiring & WIRING_MARK;
    table.lost = 0;
    position = 0;
    turntable_set_manner((struct turntable_manner){0, 0, SETTLING_US, APPROACH_COUNTER_CLOCKWISE});
}

void turntable_set_manner(struct turntable_manner request)
{
    if (!request.speed || request.speed > SPEED)
        request.speed = SPEED;
    if (request.speed < SLOWEST_RAMP)
        request.speed = SLOWEST_RAMP;
    if (!request.acceleration || request.acceleration > ACCELERATION)
        request.acceleration = ACCELERATION;
    if (request.acceleration < GENTLEST_RAMP)
        request.acceleration = GENTLEST_RAMP;
    table.manner = request;
}

struct turntable_manner turntable_manner(void) { return table.manner; }

enum zero turntable_zero(void) { return table.zero; }

bool turntable_homed(void) { return table.zero != ZERO_UNKNOWN; }

static int32_t steps_of(int32_t microdegrees)
{
    int64_t twice = 2 * (int64_t)microdegrees * MICROSTEPS;
    return (int32_t)((twice + (twice < 0 ? -TURN_MICRODEGREES : TURN_MICRODEGREES)) / (2 * (int64_t)TURN_MICRODEGREES));
}

static int32_t microdegrees_of(int32_t steps) { return (int32_t)((int64_t)steps * TURN_MICRODEGREES / MICROSTEPS); }

int16_t turntable_steps(void) { return (int16_t)position; }

int32_t turntable_microdegrees(void) { return turntable_homed() ? microdegrees_of(position_now()) : 0; }

int32_t turntable_nearest(int32_t microdegrees) { return microdegrees_of(steps_of(microdegrees)); }

bool turntable_reaches(int64_t microdegrees)
{
    return microdegrees >= -REACH_DEGREES * 1000000L && microdegrees <= REACH_DEGREES * 1000000L;
}

// Expect the mark at its next position counter-clockwise of here that is beyond the backlash; keep an earlier one.
static void await_mark(void)
{
    int32_t clear = position_now() + STEPS_OF_DEGREES(BACKLASH_DEGREES);
    int32_t turns = clear / MICROSTEPS - (clear % MICROSTEPS < 0);
    int32_t next = (turns + 1) * MICROSTEPS;
    if (next < table.awaited)
        table.awaited = next;
}

// After a counter-clockwise leg, the table may settle beyond the edge of the mark. It passes only once, so it counts.
static void take_edge_at_rest(void)
{
    bool marked = marked_now();
    mark_passed = marked && !was_marked && direction > 0;
    mark_position = position;
    was_marked = marked;
}

static void start(enum leg leg, int32_t steps, uint16_t speed)
{
    table.leg = leg;
    take_edge_at_rest();
    direction = steps < 0 ? -1 : 1;
    if (direction > 0)
        await_mark();
    ramp = ramp_of((uint16_t)(steps < 0 ? -steps : steps), table.manner.acceleration, speed);
    uint16_t first = ramp_next(&ramp);
    motor_start((direction > 0) != ((table.wiring & WIRING_MOTOR) != 0), first);
}

static void stop(void)
{
    interrupts_off();
    ramp_halt(&ramp);
    interrupts_on();
}

static void settle(uint64_t now_us)
{
    table.leg = SETTLING;
    table.settled_us = now_us + table.manner.settle_us;
}

// Start towards the target. False if the table is already there.
static bool approach(void)
{
    int32_t way = table.target - position_now();
    int32_t past = STEPS_OF_DEGREES(BACKLASH_DEGREES);
    if (way < 0 && table.manner.approach == APPROACH_COUNTER_CLOCKWISE)
        start(PASSING, way - past, table.manner.speed);
    else if (way > 0 && table.manner.approach == APPROACH_CLOCKWISE)
        start(PASSING, way + past, table.manner.speed);
    else if (way)
        start(APPROACHING, way, table.manner.speed);
    return way != 0;
}

static void give_up(enum turntable_trouble trouble)
{
    table.trouble = trouble;
    table.zero = ZERO_UNKNOWN;
    table.leg = HALTING;
    stop();
}

// A first Home crawls, so that a person can stop it if a wire is wrong.
static uint16_t homing_speed(uint16_t fastest) { return table.homed_before ? fastest : CRAWL_SPEED; }

static bool within_homing_limit(int32_t steps)
{
    int32_t limit = STEPS_OF_DEGREES(HOMING_LIMIT_DEGREES);
    return steps > -limit && steps < limit;
}

/* Start towards the edge of the cam. Never beyond HOMING_LIMIT from the last known zero, or from where the board
 * started: with one wrong wire, every Home would wind the cable further. With wiring that has never worked, only as far
 * as a table that was left within its first turn needs. */
static void seek(enum leg leg, uint16_t speed)
{
    int32_t here = position_now();
    int32_t way = STEPS_OF_DEGREES(HOMING_LIMIT_DEGREES);
    way = leg == SEEKING_ABOVE ? way - here : way + here;
    int32_t most = STEPS_OF_DEGREES(UNPROVEN_DEGREES);
    if (!(table.wiring & WIRING_PROVEN) && way > most)
        way = most;
    if (way <= 0) {
        give_up(TROUBLE_LIMIT);
        return;
    }
    table.was_high = home_mark();
    table.changed_at = here;
    start(leg, leg == SEEKING_ABOVE ? way : -way, homing_speed(speed));
}

// A servo goes to its zero by itself. At least one step, because the first one starts its pulses.
static void return_to_zero(void)
{
    if (position == 0)
        position = -1;
    start(RETURNING, -position, table.manner.speed);
}

static void begin(void)
{
    enum order order = table.order;
    table.order = NOTHING;
    table.leg = STILL;
    if (order == TO_TURN)
        approach();
    else if (order == TO_HOME && HOMING == HOMING_ABSOLUTE)
        return_to_zero();
    else if (order == TO_HOME) {
        table.mark_changed = false;
        seek(above_zero() ? SEEKING_BELOW : SEEKING_ABOVE, HOMING_SPEED);
    }
}

static void take(enum order order)
{
    table.trouble = TROUBLE_NONE;
    table.order = order;
    if (table.leg == STILL)
        begin();
}

void turntable_home(void)
{
    table.zero = ZERO_UNKNOWN;
    take(TO_HOME);
}

void turntable_turn(int32_t microdegrees)
{
    table.target = steps_of(microdegrees);
    take(TO_TURN);
}

bool turntable_can_jog(int32_t microdegrees)
{
    if (microdegrees > JOG_DEGREES * 1000000L || microdegrees < -JOG_DEGREES * 1000000L)
        return false;
    int32_t steps = position_now() + steps_of(microdegrees);
    return turntable_homed() ? turntable_reaches(microdegrees_of(steps)) : within_homing_limit(steps);
}

void turntable_jog(int32_t microdegrees)
{
    table.target = position_now() + steps_of(microdegrees);
    take(TO_TURN);
}

/* Steps of the other direction count from the same place, so that repeated Homes cannot wind the cable further. A servo
 * keeps its position, because its pulse follows it. */
static void mirror_position(void)
{
    interrupts_off();
    position = -position;
    direction = -direction; // the table may still slow down
    interrupts_on();
}

void turntable_invert(uint8_t change, uint8_t inverted)
{
    if (HOMING != HOMING_ABSOLUTE && (table.wiring ^ inverted) & change & WIRING_MOTOR)
        mirror_position();
    table.wiring = (uint8_t)((table.wiring & ~(change | WIRING_PROVEN)) | inverted);
    mark_inverted = table.wiring & WIRING_MARK;
    table.zero = ZERO_UNKNOWN;
    table.homed_before = false;
    store_wiring(table.wiring);
}

uint8_t turntable_inverted(void) { return table.wiring & (uint8_t)~WIRING_PROVEN; }

void turntable_stay(void) { take(NOTHING); }

void turntable_set_zero(void)
{
    interrupts_off();
    position = 0;
    interrupts_on();
    table.zero = ZERO_HAND;
    table.awaited = MICROSTEPS;
}

void turntable_halt(void)
{
    table.order = NOTHING;
    if (table.leg == STILL)
        return;
    table.leg = HALTING;
    stop();
}

void turntable_release(void)
{
    turntable_halt();
    motor_release();
    table.zero = ZERO_UNKNOWN;
}

/* Back over the edge of the cam to the mark. A table that turns the wrong way finds the mark, too, but further away. The
 * edge of the cam is less than half a turn below the mark, so the mark is low there, unless its wire is wrong. */
static void creep(void)
{
    if (marked_now()) {
        give_up(table.mark_changed ? TROUBLE_WRONG_WAY : TROUBLE_NO_MARK);
        return;
    }
    table.target = position_now();
    start(CREEPING, STEPS_OF_DEGREES(CREEP_DEGREES), homing_speed(CREEP_SPEED));
}

// Set zero to the position of the mark.
static void set_zero(void)
{
    interrupts_off();
    position -= mark_position;
    ramp_halt(&ramp);
    interrupts_on();
    mark_passed = false;
    table.zero = ZERO_MARK;
    table.homed_before = true;
    table.wiring |= WIRING_PROVEN;
    store_wiring(table.wiring);
    table.awaited = MICROSTEPS;
    table.target = 0;
    // the table first slows down, then returns to zero
    table.leg = APPROACHING;
}

static void take_mark(void)
{
    if (mark_position - table.target <= STEPS_OF_DEGREES(MARK_DEGREES))
        set_zero();
    else
        give_up(TROUBLE_WRONG_WAY);
}

static void lose(int32_t steps)
{
    table.lost += steps;
    give_up(TROUBLE_LOST_STEPS);
}

static void check_mark(void)
{
    int32_t here = position_now(); // read before mark_passed: a mark that passes in between is not missing
    if (!mark_passed) {
        if (here > table.awaited + STEPS_OF_DEGREES(MISSING_DEGREES))
            lose(here - table.awaited);
        return;
    }
    interrupts_off();
    int32_t off = mark_position;
    mark_passed = false;
    interrupts_on();
    int32_t seen = off;
    off %= MICROSTEPS;
    if (off > MICROSTEPS / 2)
        off -= MICROSTEPS;
    if (off < -MICROSTEPS / 2)
        off += MICROSTEPS;
    if (off > LOST_STEPS || off < -LOST_STEPS)
        lose(off);
    else
        table.awaited = seen - off + MICROSTEPS;
}

// While the table seeks the cam, the mark must change in every half turn. Otherwise its wire is open, or nothing turns.
static void watch_mark(void)
{
    int32_t here = position_now();
    bool high = home_mark();
    if (high != table.was_high) {
        table.was_high = high;
        table.changed_at = here;
        table.mark_changed = true;
    }
    int32_t since = here - table.changed_at;
    int32_t most = STEPS_OF_DEGREES(MARK_WITHIN_DEGREES);
    if (since > most || since < -most)
        give_up(TROUBLE_NO_MARK);
}

static void watch(void)
{
    if (table.leg == SEEKING_ABOVE && above_zero())
        stop();
    else if (table.leg == SEEKING_BELOW && !above_zero())
        stop();
    else if (table.leg == SEEKING_ABOVE || table.leg == SEEKING_BELOW)
        watch_mark();
    else if (table.leg == CREEPING && mark_passed)
        take_mark();
    else if (table.zero == ZERO_MARK && HOMING == HOMING_WITH_SWITCHES)
        check_mark();
}

static void next_leg(uint64_t now_us)
{
    switch (table.leg) {
    case SEEKING_ABOVE:
        if (above_zero())
            seek(SEEKING_BELOW, SPEED);
        else
            give_up(TROUBLE_CAM);
        break;
    case SEEKING_BELOW:
        if (!above_zero())
            creep();
        else
            give_up(TROUBLE_CAM);
        break;
    case CREEPING:
        give_up(TROUBLE_NO_MARK);
        break;
    case PASSING:
    case APPROACHING:
        if (!approach())
            settle(now_us);
        break;
    case RETURNING:
        table.zero = ZERO_MARK;
        settle(now_us + FULL_TRAVEL_US);
        break;
    case SETTLING:
        if (now_us >= table.settled_us)
            table.leg = STILL;
        break;
    case HALTING:
        begin();
        break;
    case STILL:
        break;
    }
}

bool turntable_work(uint64_t now_us)
{
    if (table.leg == STILL)
        return false;
    bool turning = motor_turning();
    // `turning` is read first, so that a mark passed in the last steps of a leg is seen
    watch();
    if (!turning)
        next_leg(now_us);
    return table.leg != STILL;
}

enum turntable_trouble turntable_trouble(void) { return table.trouble; }

int32_t turntable_lost(void) { return table.lost; }
