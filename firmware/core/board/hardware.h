/* What the portable part asks of a board, in one page: porting the firmware is writing these functions anew.
 *
 * `line.h` and `flash.h` belong to it, and `board_facts.h`, which holds the constants of one board. Nothing here blocks.
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
    uint16_t rearm_us; // from an echo until the next can be heard
    uint8_t echoes; // how many to hear at most
    bool trace;
};

struct ping_result {
    uint64_t fired_us; // start of transmission
    uint32_t *echoes; // ticks from there, earliest first; free to be changed
    uint8_t echo_count;
    const uint8_t *trace;
    uint16_t trace_size; // samples
};

void ping_start(const struct ping_order *order);
bool ping_over(void); // whether it has listened long enough; it then lets the ranging board rest
struct ping_result ping_result(void); // stays as it is until the next ping

/* Turntable motor. `turntable_step` is called by an interrupt for as long as it returns a time. */

void motor_start(bool counter_clockwise, uint16_t first_ticks); // enables it too
bool motor_turning(void);
void motor_release(void);
bool home_mark(void); // half of the axle's turn, from 0 to 180 degrees
bool home_side(void); // cam behind a gear: true from somewhere below 0 upwards, over the whole reach of the cable

/* The rest. */

int16_t thermometer(void); // 0.01 °C, or NO_TEMPERATURE
uint32_t boot_count(void); // starts, this one included
uint8_t reset_cause(void); // enum reset_cause
uint16_t stack_free(void); // bytes of the stack never used; 0: not measured
void interrupts_off(void); // what an interrupt writes in more than one byte is read and written between these two
void interrupts_on(void);

#endif
