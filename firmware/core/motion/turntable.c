#include "turntable.h"

#include "angles.h" // steps_of
#include "board_facts.h" // MICROSTEPS, speeds
#include "hardware.h" // motor, home switch
#include "homing_facts.h" // JOG_DEGREES
#include "limits.h" // homing_limit
#include "manner.h" // turntable_manner
#include "messages.h" // enum approach
#include "ramp.h" // struct ramp
#include "wiring.h" // switches

#define FULL_TRAVEL_US 1000000 // of a servo, whose angle is unknown before its first pulse

enum leg {
    STILL,
    SEEKING_ABOVE, // counter-clockwise until the switch reports: above zero
    SEEKING_BELOW, // clockwise until the switch reports: below zero
    SEARCHING, // for the mark on the other side, where it must not be
    CLEARING, // further clockwise, so that the edge of the mark is out of reach of noise
    CREEPING, // counter-clockwise to the mark
    PASSING, // past the heading, to return to it
    APPROACHING, // to the heading
    RETURNING, // to the zero of a servo
    HALTING,
    SETTLING,
};

enum order { NOTHING, TO_HOME, TO_TURN, TO_RETURN }; // to where a Home began

static struct {
    enum leg leg;
    enum order order; // starts as soon as the table is at rest
    enum turntable_trouble trouble;
    enum zero zero;
    bool homed_before; // a Home has succeeded since the start
    bool was_high; // level of the mark while seeking the cam
    bool mark_changed; // in this Home
    bool searched; // in this Home: the first switch was found, or the other side is searched
    int32_t began_at; // this Home, steps
    uint8_t tries; // Homes since the last one that succeeded
    int32_t changed_at; // where this level changed last, steps
    int32_t target; // steps
    int32_t awaited; // next expected position of the mark, steps
    int32_t lost; // steps
    uint64_t settled_us;
} table;

// shared with the step interrupt
static struct ramp ramp;
static volatile int32_t position; // steps; before the first zero from the start of the board
static int8_t direction;
static bool was_marked;
static volatile bool mark_passed; // counter-clockwise; only this edge is exact
static volatile int32_t mark_position;

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
    table.tries = 0;
    wiring_reset();
    table.lost = 0;
    position = 0;
    turntable_set_manner((struct turntable_manner){0, 0, SETTLING_US, APPROACH_COUNTER_CLOCKWISE});
}

enum zero turntable_zero(void) { return table.zero; }

bool turntable_homed(void) { return table.zero != ZERO_UNKNOWN; }

int16_t turntable_steps(void) { return (int16_t)position; }

int32_t turntable_microdegrees(void) { return turntable_homed() ? microdegrees_of(position_now()) : 0; }

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
    ramp = ramp_of((uint16_t)(steps < 0 ? -steps : steps), turntable_manner().acceleration, speed);
    uint16_t first = ramp_next(&ramp);
    motor_start((direction > 0) != motor_inverted(), first);
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
    table.settled_us = now_us + turntable_manner().settle_us;
}

// Start towards the target. False if the table is already there.
static bool approach(void)
{
    int32_t way = table.target - position_now();
    int32_t past = STEPS_OF_DEGREES(BACKLASH_DEGREES);
    if (way < 0 && turntable_manner().approach == APPROACH_COUNTER_CLOCKWISE)
        start(PASSING, way - past, turntable_manner().speed);
    else if (way > 0 && turntable_manner().approach == APPROACH_CLOCKWISE)
        start(PASSING, way + past, turntable_manner().speed);
    else if (way)
        start(APPROACHING, way, turntable_manner().speed);
    return way != 0;
}

/* With one switch, a Home that fails returns to where it began, so that Homes between restarts do not add up. The next one
 * is limited as if the wiring had never worked: the level of the mark shows the side of zero only within half a turn. */
static void give_up(enum turntable_trouble trouble)
{
    table.trouble = trouble;
    table.zero = ZERO_UNKNOWN;
    table.leg = HALTING;
    if (one_switch()) {
        wiring_prove(false);
        table.order = trouble == TROUBLE_LOST_STEPS ? NOTHING : TO_RETURN;
    }
    stop();
}

// A first Home crawls, so that a person can stop it if a wire is wrong.
static uint16_t homing_speed(uint16_t fastest) { return table.homed_before ? fastest : CRAWL_SPEED; }

/* Start towards the edge of the switch. Never beyond the homing limit from the last known zero, or from where the board
 * started: with one wrong wire, every Home would wind the cable further. */
static void seek(enum leg leg, uint16_t speed)
{
    int32_t here = position_now();
    int32_t way = leg == SEEKING_ABOVE ? homing_limit() - here : homing_limit() + here;
    int32_t most = homing_most();
    if (way > most)
        way = most;
    table.was_high = home_mark();
    table.changed_at = here;
    if (way > 0)
        start(leg, leg == SEEKING_ABOVE ? way : -way, homing_speed(speed));
    else
        give_up(TROUBLE_LIMIT);
}

/* The switch has not changed. With one switch that has never worked, look on the other side: if it changes there, a wire
 * is inverted, and not open. */
static void look_elsewhere(void)
{
    int32_t most = STEPS_OF_DEGREES(ONE_SWITCH_UNPROVEN_DEGREES);
    int32_t there = table.began_at + (table.leg == SEEKING_BELOW ? most : -most);
    if (!one_switch())
        give_up(TROUBLE_CAM);
    else if (wiring_proven() || table.searched || !within_homing_limit(there))
        give_up(TROUBLE_NO_MARK);
    else {
        table.searched = true;
        table.was_high = home_mark();
        start(SEARCHING, there - position_now(), homing_speed(SPEED));
    }
}

static void go_back(void)
{
    table.target = table.began_at;
    if (table.target != position_now())
        start(APPROACHING, table.target - position_now(), homing_speed(SPEED));
}

// A servo goes to its zero by itself. At least one step, because the first one starts its pulses.
static void return_to_zero(void)
{
    if (position == 0)
        position = -1;
    start(RETURNING, -position, turntable_manner().speed);
}

static void find_zero(void)
{
    table.mark_changed = table.searched = false;
    table.began_at = position_now();
    // a table that turns in one direction only is wound further by every Home, although it counts none of that
    if (one_switch() && table.tries == ONE_SWITCH_TRIES)
        give_up(TROUBLE_LIMIT);
    else {
        table.tries += one_switch();
        seek(above_zero() ? SEEKING_BELOW : SEEKING_ABOVE, HOMING_SPEED);
    }
}

static void begin(void)
{
    enum order order = table.order;
    table.order = NOTHING;
    table.leg = STILL;
    if (order == TO_TURN)
        approach();
    else if (order == TO_RETURN)
        go_back();
    else if (order == TO_HOME && HOMING == HOMING_ABSOLUTE)
        return_to_zero();
    else if (order == TO_HOME)
        find_zero();
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
    if (HOMING != HOMING_ABSOLUTE && change & WIRING_MOTOR && motor_inverted() != ((inverted & WIRING_MOTOR) != 0))
        mirror_position();
    wiring_set(change, inverted);
    table.zero = ZERO_UNKNOWN;
    table.homed_before = false;
}

void turntable_stay(void) { take(NOTHING); }

void turntable_set_zero(void)
{
    interrupts_off();
    position = 0;
    interrupts_on();
    table.zero = ZERO_HAND;
    table.awaited = MICROSTEPS;
    if (one_switch())
        wiring_prove(false); // this zero may be further than half a turn from the mark
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

/* Back over the edge of the switch to the mark. A table that turns the wrong way finds the mark, too, but further away. The
 * edge of the cam is less than half a turn below the mark, so the mark is low there, unless its wire is wrong. */
static void creep(void)
{
    if (marked_now()) {
        give_up(table.mark_changed ? TROUBLE_WRONG_WAY : TROUBLE_NO_MARK);
        return;
    }
    table.target = position_now();
    start(CREEPING, creep_most(), homing_speed(CREEP_SPEED));
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
    table.tries = 0;
    wiring_prove(true);
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
    off = steps_beside(off, MICROSTEPS);
    if (off > LOST_STEPS || off < -LOST_STEPS)
        lose(off);
    else
        table.awaited = seen - off + MICROSTEPS;
}

// With one switch, the table never turns beyond half a turn. So the level of the mark must always be that of its side.
static void check_side(void)
{
    int32_t here = position_now();
    int32_t near = STEPS_OF_DEGREES(MISSING_DEGREES);
    if ((here > near || here < -near) && marked_now() != (here > 0))
        lose(steps_beside(here, MICROSTEPS / 2)); // at least these
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
    else if (table.leg == SEARCHING && home_mark() != table.was_high)
        give_up(TROUBLE_WRONG_WAY);
    else if (table.leg == CREEPING && mark_passed)
        take_mark();
    else if (table.zero == ZERO_MARK && HOMING == HOMING_WITH_SWITCHES)
        check_mark();
    if (table.zero == ZERO_MARK && one_switch())
        check_side();
}

static void next_leg(uint64_t now_us)
{
    switch (table.leg) {
    case SEEKING_ABOVE:
        if (above_zero()) {
            table.searched = true;
            seek(SEEKING_BELOW, SPEED);
        } else
            look_elsewhere();
        break;
    case SEEKING_BELOW:
        if (above_zero())
            look_elsewhere();
        else if (one_switch())
            start(CLEARING, -STEPS_OF_DEGREES(CLEAR_DEGREES), homing_speed(SPEED));
        else
            creep();
        break;
    case CLEARING:
        creep();
        break;
    case SEARCHING:
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
