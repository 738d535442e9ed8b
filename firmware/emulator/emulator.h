/* Emulated board: the real firmware on libsimavr, with models of everything that is connected to the chip.
 *
 *   emulator.c         loads and runs the firmware
 *   ranging_model.c    the 6500: INIT, BLNK and BINH in, ECHO and the envelope out
 *   turntable_model.c  motor, gear, table, home switch
 *   serial_line.c      the serial line, on a pseudo-terminal
 *   parent.c           the process that started the emulator and computes the echoes
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
    const char *eeprom; // file that keeps the EEPROM; NULL: none
    const char *link; // symbolic link to the pseudo-terminal; NULL: none
    double pace; // factor to real time; 0: as fast as possible
    double initial_degrees; // initial angle of the table, degrees
    double temperature; // °C; NAN: no thermistor
    bool any_baud; // ignore the baud rate of the host
};

struct ping {
    double degrees;
    uint16_t sweep;
    uint8_t index;
};

struct echoes {
    unsigned count;
    double times[ECHOES_MOST]; // s
    double rate, start; // of the trace, Hz and s
    unsigned samples;
    float *trace; // 0 to 1
};

void die(const char *why);
bool end_requested(void); // whether a signal has requested the end
void switch_off(void); // saves the EEPROM and ends the program
double seconds(const avr_t *avr); // time of the board

/* emulator.c */
enum wiring_fault { // as in sonarhw/device/wiring_faults.py
    CAM_INVERTED = 1,
    CAM_OPEN = 2,
    MOTOR_REVERSED = 4,
    MARK_OPEN = 8,
    MARK_INVERTED = 16,
    MOTOR_OPEN = 32,
    ECHO_LOW = 64,
    ECHO_HIGH = 128,
    NOISE_ON_INIT = 256,
    THERMISTOR_OPEN = 512,
    THERMISTOR_SHORTED = 1024,
    BLNK_OPEN = 2048,
};
void miswire(avr_t *avr, uint32_t faults);
bool miswired(enum wiring_fault fault);
uint16_t symbol(const char *name); // address in the chip's memory
void reset_board(avr_t *avr); // as with the reset button
void hang_board(avr_t *avr); // endless loop; only the watchdog ends it
void *make_irq_listener(avr_t *avr, char port, int bit, void (*changed)(avr_t *, bool));
void set_pin(avr_t *avr, char port, int bit, bool high);
const uint32_t *longest_interrupts(void); // longest duration of each handler in cycles, INTERRUPTS values

/* ranging_model.c */
void ranging_start(avr_t *avr, double temperature);
void ranging_reset(avr_t *avr);
void ranging_show(avr_t *avr); // set the level of ECHO
bool ranging_listens(void); // INIT is high
void ranging_time_conversion(avr_t *avr); // call it after every instruction

/* turntable_model.c */
void turntable_start(avr_t *avr, double degrees);
void turntable_reset(avr_t *avr);
double turntable_degrees(void);
void turntable_slip(double microsteps);
void turntable_wedge(avr_t *avr, double seconds);
void turntable_show(avr_t *avr); // set the levels of the switches

/* serial_line.c */
void line_start(avr_t *avr, const char *link, bool any_baud);
void line_reset(void);
void line_poll(avr_t *avr);
void line_end(void);
double line_silence(const avr_t *avr); // s of board time since the last byte of a connected client
const char *line_name(void);

/* parent.c */
void parent_start(int descriptor);
void parent_poll(avr_t *avr);
void parent_request_echoes(avr_t *avr, const struct ping *ping, struct echoes *echoes);
void parent_report_ready(const char *url);

#endif
