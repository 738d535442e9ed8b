/* Test board for the portable part of the firmware, in plain variables.
 *
 * `host_advance` advances the time. The motor follows its ramp, moves at once, or does not move. Every ping returns the
 * echoes of `host_set_echoes`. The line transmits everything at once.
 */
#include "host_board.h"

#include <string.h>

#include "board_facts.h" // board_firmware
#include "conversation.h" // conversation_run
#include "hardware.h" // the functions implemented here
#include "line.h"
#include "messages.h" // RESET_CAUSE_POWER
#include "turntable.h" // turntable_step

#define SENT_MOST (1 << 20)
#define RECEIVED_MOST (1 << 16)
#define STORED_ECHOES 256
#define ROUNDS 3 // of the main loop at each point of time
#define STEPS_AT_ONCE 20 // between two rounds, with a motor that moves at once
#define CAM_STEPS (-400) // edge of the cam: below the mark, as on the real turntable

uint32_t host_trace_period_ns = 13000;

static struct {
    uint64_t now;
    uint32_t grain;
    uint8_t sent[SENT_MOST];
    uint32_t sent_size;
    uint8_t received[RECEIVED_MOST];
    uint32_t received_at, received_size;
    uint32_t baud;
    const char *firmware, *serial, *profile;
    int16_t temperature;
    enum host_motor mode;
    uint32_t wiring; // enum host_wiring
    uint8_t stored; // as in the EEPROM
    uint8_t *lost[LOST_MOST];
    uint8_t lost_count;
    bool turning, forwards, powered;
    uint64_t step_due_ns;
    int32_t position;
    uint64_t fired_us, over_us;
    uint32_t echoes[STORED_ECHOES], result[ECHOES_MOST];
    uint8_t echo_count;
    const uint8_t *trace;
    uint16_t trace_size, traced;
    uint32_t stepped_while_listening, sent_while_listening;
} host;

void host_start(void)
{
    memset(&host, 0, sizeof host);
    host.grain = 1;
    host.baud = FIRST_BAUD;
    host.firmware = host.serial = host.profile = "";
    host.temperature = NO_TEMPERATURE;
    conversation_reset();
}

void host_identity(const char *firmware, const char *serial, const char *profile)
{
    host.firmware = firmware;
    host.serial = serial;
    host.profile = profile;
}

void host_grain(uint32_t us) { host.grain = us; }

void host_temperature(int16_t centidegrees) { host.temperature = centidegrees; }

void host_set_position(int32_t steps) { host.position = steps; }

int32_t host_position(void) { return host.position; }

bool host_powered(void) { return host.powered; }

uint32_t host_baud(void) { return host.baud; }

uint32_t host_violations(void) { return host.stepped_while_listening + host.sent_while_listening; }

void host_wiring(uint32_t faults) { host.wiring = faults; }

void host_motor(enum host_motor mode) { host.mode = mode; }

void host_set_echoes(const uint32_t *ticks, uint8_t count, const uint8_t *trace, uint16_t trace_size,
                     uint32_t period_ns)
{
    memcpy(host.echoes, ticks, count * sizeof *ticks);
    host.echo_count = count;
    host.trace = trace;
    host.trace_size = trace_size;
    host_trace_period_ns = period_ns;
}

void host_set_lost(const uint16_t *indices, uint8_t count)
{
    for (host.lost_count = 0; host.lost_count < count; host.lost_count++)
        host.lost[host.lost_count] = (uint8_t *)host.trace + indices[host.lost_count];
}

void host_restart(void)
{
    uint8_t stored = host.stored;
    uint32_t wiring = host.wiring, grain = host.grain;
    int32_t position = host.position;
    host_start();
    host.stored = stored;
    host.wiring = wiring;
    host.grain = grain;
    host.position = position;
    conversation_reset();
}

void host_send(const uint8_t *bytes, uint32_t size)
{
    if (host.received_at == host.received_size)
        host.received_at = host.received_size = 0;
    uint32_t room = RECEIVED_MOST - host.received_size;
    memcpy(host.received + host.received_size, bytes, size < room ? size : room);
    host.received_size += size < room ? size : room;
}

uint32_t host_receive(uint8_t *bytes, uint32_t most)
{
    uint32_t size = host.sent_size < most ? host.sent_size : most;
    memcpy(bytes, host.sent, size);
    host.sent_size = 0;
    return size;
}

static bool listening(void) { return host.now < host.over_us; }

static bool counter_clockwise(void)
{
    return host.wiring & HOST_DIRECTION_OPEN || host.forwards != ((host.wiring & HOST_MOTOR_REVERSED) != 0);
}

static void make_step(void)
{
    if (host.mode != HOST_MOTOR_SLIPPING)
        host.position += counter_clockwise() ? 1 : -1;
    host.stepped_while_listening += listening();
    uint16_t ticks = turntable_step();
    host.step_due_ns += ticks * 500ULL;
    host.turning = ticks != 0;
}

static void turn(void)
{
    // a few steps at a time, so that the firmware sees the switches
    for (int left = STEPS_AT_ONCE; left && host.mode == HOST_MOTOR_AT_ONCE && host.turning; left--)
        make_step();
    while (host.turning && host.mode != HOST_MOTOR_AT_ONCE && host.mode != HOST_MOTOR_HELD &&
           host.step_due_ns <= host.now * 1000)
        make_step();
}

void host_advance(uint64_t until_us)
{
    for (;;) {
        // several rounds, because one action may wait for another
        for (int round = 0; round < ROUNDS || (host.turning && host.mode == HOST_MOTOR_AT_ONCE); round++) {
            turn();
            conversation_run();
        }
        if (host.now >= until_us)
            return;
        host.now = host.now + host.grain < until_us ? host.now + host.grain : until_us;
    }
}

/* hardware.h */

uint64_t clock_us(void) { return host.now; }

void ping_start(const struct ping_order *order)
{
    host.fired_us = host.now;
    host.over_us = host.now + order->listen_us;
    host.traced = order->trace ? host.trace_size : 0;
}

bool ping_over(void) { return !listening(); }

struct ping_result ping_result(void)
{
    memcpy(host.result, host.echoes, sizeof host.result);
    return (struct ping_result){host.fired_us, host.result, host.echo_count, host.trace, host.traced,
                                host.lost, host.lost_count};
}

void motor_start(bool counter_clockwise, uint16_t first_ticks)
{
    host.powered = true;
    host.forwards = counter_clockwise;
    host.turning = true;
    host.step_due_ns = host.now * 1000 + first_ticks * 500ULL;
}

bool motor_turning(void) { return host.turning; }

void motor_release(void)
{
    host.powered = false;
    host.turning = false;
}

// an open wire is high, because of its pull-up
bool home_mark(void)
{
    bool mark = ((host.position % MICROSTEPS) + MICROSTEPS) % MICROSTEPS < MICROSTEPS / 2;
    return mark != ((host.wiring & HOST_MARK_INVERTED) != 0) || host.wiring & HOST_MARK_OPEN;
}

bool home_side(void)
{
    bool side = (host.position > CAM_STEPS) != ((host.wiring & HOST_CAM_INVERTED) != 0);
    return side || host.wiring & HOST_CAM_OPEN;
}

uint8_t turntable_inputs(void) { return (home_mark() ? INPUT_MARK : 0) | (home_side() ? INPUT_CAM : 0); }

uint8_t ranging_inputs(void) { return 0; }

uint8_t stored_wiring(void) { return host.stored; }

void store_wiring(uint8_t wiring) { host.stored = wiring; }

int16_t thermometer(void) { return host.temperature; }

uint32_t boot_count(void) { return 1; }

uint8_t reset_cause(void) { return RESET_CAUSE_POWER; }

uint16_t stack_free(void) { return 0; }

void interrupts_off(void) {}

void interrupts_on(void) {}

/* line.h */

uint8_t line_write(const uint8_t *bytes, uint8_t count)
{
    host.sent_while_listening += listening();
    // bytes that are not read in time are lost
    if (host.sent_size + count > SENT_MOST)
        host.sent_size = 0;
    memcpy(host.sent + host.sent_size, bytes, count);
    host.sent_size += count;
    return count;
}

bool line_quiet(void) { return true; }

int16_t line_read(void) { return host.received_at < host.received_size ? host.received[host.received_at++] : -1; }

uint32_t line_overruns(void) { return 0; }

void line_set_baud(uint32_t baud) { host.baud = baud; }

bool line_can(uint32_t baud) { return baud == 250000 || baud == 500000 || baud == 1000000; }

/* board_facts.h */

static struct text text_of(const char *bytes) { return (struct text){bytes, (uint8_t)strlen(bytes)}; }

struct text board_firmware(void) { return text_of(host.firmware); }

struct text board_serial(void) { return text_of(host.serial); }

struct text board_profile(void) { return text_of(host.profile); }
