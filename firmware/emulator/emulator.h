/* The board that is not there: the real firmware on libsimavr, and round it the things it is wired to.
 *
 *   emulator.c         loads the firmware, lets time pass
 *   ranging_model.c    the 6500: INIT, BLNK and BINH in, ECHO and the envelope out
 *   turntable_model.c  motor, gear, table, home switch
 *   serial_line.c      the serial line, on a pseudo-terminal
 *   parent.c           the program that started it, which has the room
 */
#ifndef EMULATOR_H
#define EMULATOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <simavr/sim_avr.h>

#define FREQUENCY 16000000
#define ECHOES_MOST 256
#define INTERRUPTS 57

struct options {
    const char *elf;
    const char *eeprom; // file that outlives the process; NULL: none
    const char *link; // name for the pseudo-terminal; NULL: none
    double pace; // times real time; 0: as fast as it goes
    double stands; // degrees, where the table stands at first
    double temperature; // °C; NAN: no thermistor
    bool any_baud; // hosts need not set the speed of the line
};

struct ping {
    double degrees;
    uint16_t sweep;
    uint8_t index;
};

struct heard {
    unsigned count;
    double times[ECHOES_MOST]; // s
    double rate, start; // of the trace, Hz and s
    unsigned samples;
    float *trace; // 0 to 1
};

void die(const char *why);
bool asked_to_end(void); // by a signal
void switch_off(void); // ends the program; what the EEPROM holds is kept
double seconds(const avr_t *avr); // of the board's time

/* emulator.c */
uint16_t symbol(const char *name); // address in the chip's memory
void reset_board(avr_t *avr); // the button
void hang_board(avr_t *avr); // what only a watchdog ends
void *make_irq_listener(avr_t *avr, char port, int bit, void (*changed)(avr_t *, bool));
void set_pin(avr_t *avr, char port, int bit, bool high);
const uint32_t *longest_interrupts(void); // cycles of each vector's handler, INTERRUPTS of them

/* ranging_model.c */
void ranging_start(avr_t *avr, double temperature);
void ranging_reset(avr_t *avr);
bool ranging_listens(void); // INIT is high

/* turntable_model.c */
void turntable_start(avr_t *avr, double degrees);
void turntable_reset(avr_t *avr);
double turntable_degrees(void);
void turntable_slip(double microsteps);
void turntable_wedge(avr_t *avr, double seconds);

/* serial_line.c */
void line_start(avr_t *avr, const char *link, bool any_baud);
void line_reset(void);
void line_poll(avr_t *avr);
void line_end(void);
double line_silence(const avr_t *avr); // s of the board's time since a client that is there was heard
const char *line_name(void);

/* parent.c */
void parent_start(int descriptor);
void parent_poll(avr_t *avr);
void parent_hear(avr_t *avr, const struct ping *ping, struct heard *heard);
void parent_tell_ready(const char *url);

#endif
