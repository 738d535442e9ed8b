/* Functions that a board must provide. To port the firmware, implement these and those of `line.h`.
 *
 * A board also provides `flash.h` and its constants in `board_facts.h`. None of these functions blocks.
 */
#ifndef HARDWARE_H
#define HARDWARE_H

#include <stdbool.h>
#include <stdint.h>

/* Time. */

uint64_t clock_us(void); // since the start; never runs backwards

/* Ranging board. A tick is half a microsecond. */

struct ping_order {
    uint32_t listen_us;
    uint32_t blanking_us;
    uint16_t rearm_us; // from an echo until the receiver is armed again
    uint8_t echoes; // maximum number to record
    bool trace;
};

struct ping_result {
    uint64_t fired_us; // start of transmission
    uint32_t *echoes; // ticks from there, earliest first; the caller may change them
    uint8_t echo_count;
    const uint8_t *trace;
    uint16_t trace_size; // samples
    uint8_t *const *lost; // samples that were not measured and repeat a neighbour, in order
    uint8_t lost_count;
};

void ping_start(const struct ping_order *order);
bool ping_over(void); // whether listening has ended; if so, switches the ranging board off
struct ping_result ping_result(void); // valid until the next ping
uint8_t ranging_inputs(void); // enum input: the outputs of the ranging board that are high

/* Turntable motor. An interrupt calls `turntable_step` until it returns 0. */

void motor_start(bool counter_clockwise, uint16_t first_ticks); // also switches the current on
bool motor_turning(void);
void motor_release(void);
bool home_mark(void); // true from 0 to 180 degrees of each turn
bool home_side(void); // cam behind a gear: true from an angle below 0 upwards, over the whole range of the cable
uint8_t turntable_inputs(void); // enum input: the switches whose pins are high
uint8_t stored_wiring(void); // non-volatile; 0 on a new board
void store_wiring(uint8_t wiring);

/* Other functions. */

int16_t thermometer(void); // 0.01 °C, or NO_TEMPERATURE
uint32_t boot_count(void); // number of starts, including this one
uint8_t reset_cause(void); // enum reset_cause
uint16_t stack_free(void); // bytes of the stack never used; 0: not measured
void interrupts_off(void); // enclose every access to multi-byte variables that an interrupt writes
void interrupts_on(void);

#endif
