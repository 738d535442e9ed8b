/* Emulated board: the real firmware on libsimavr, with models of everything that is connected to the chip.
 *
 *   emulator.c         loads and runs the firmware
 *   options.c          the options of the emulator
 *   controllers.c      the chips and pins of the controllers
 *   pins.c             the pins of the chip, and the wires to the models
 *   ranging_model.c    the 6500: INIT, BLNK and BINH in, ECHO and the envelope out; or an HC-SR04: TRIGGER in, ECHO out
 *   turntable_model.c  stepper on a driver or on four pins, gear, table, home switches
 *   servo_model.c      a hobby servo
 *   serial_line.c      the serial line, on a pseudo-terminal
 *   pace.c             runs in real time, or faster by a factor
 *   parent.c           the process that started the emulator and computes the echoes
 *   gpio/              a GPIO chip, for the firmware as a Linux program
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
#define EMULATOR_OPTIONS "SONARHW_EMULATOR" // variable of the environment, for a Linux program

enum ranging { POLAROID, HC_SR04 };

enum turning { STEP_DIR, FOUR_COILS, SERVO };

struct pin {
    char port;
    int bit;
};

// The pins of an emulated GPIO chip are those of a chip of simavr: lines 0 to 7 are port A, and so on. Not port D, whose
// external interrupts simavr polls in every cycle.
#define GPIO_PORT(line) ((line) < 24 ? 'A' + (line) / 8 : 'F')

struct controller { // pins as in firmware/avr/<chip>/pins.h
    const char *name;
    const char *chip; // NULL: a Linux program
    uint16_t eeprom; // bytes
    struct pin init, blnk, binh, echo, step, direction, enable, mark, cam, coils[4], servo;
};

struct options {
    const char *elf;
    const struct controller *controller;
    enum ranging ranging;
    enum turning turning;
    const char *eeprom; // file that keeps the EEPROM; NULL: none
    const char *link; // symbolic link to the pseudo-terminal; NULL: none
    double pace; // factor to real time; 0: as fast as possible
    double initial_degrees; // initial angle of the table, degrees
    double temperature; // °C; NAN: no thermistor
    bool any_baud; // ignore the baud rate of the host
    uint32_t wiring; // enum wiring_fault
    double stall; // s, a Linux program is delayed by up to this now and then
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

/* options.c */
extern struct options options;
void read_options(int count, char **words); // ends the program if they are wrong

/* controllers.c */
const struct controller *controller_of(const char *combination); // NULL if unknown

/* emulator.c */
void die(const char *why);
bool end_requested(void); // whether a signal has requested the end
void switch_off(void); // saves the EEPROM and ends the program
double seconds(const avr_t *avr); // time of the board
struct ping current_ping(const avr_t *avr); // sweep and index that the firmware has set
void reset_board(avr_t *avr); // as with the reset button
void hang_board(avr_t *avr); // endless loop; only the watchdog ends it
const uint32_t *longest_interrupts(void); // longest duration of each handler in cycles, INTERRUPTS values

/* pins.c */
enum wiring_fault { // as in sonarhw/device/fake_board.py
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
    INIT_OPEN = 4096,
    STEPS_DOUBLED = 8192,
    SUPPLY_WEAK = 16384, // a ping of the 6500 restarts the chip
    LINE_NOISY = 32768,
};
void miswire(avr_t *avr, uint32_t faults);
bool miswired(enum wiring_fault fault);
void listen_to_pin(avr_t *avr, struct pin pin, void (*changed)(avr_t *, bool));
void set_pin(avr_t *avr, struct pin pin, bool high);
void restore_pins(avr_t *avr); // after a reset of the chip

/* ranging_model.c */
void ranging_start(avr_t *avr, double temperature);
void ranging_reset(avr_t *avr);
void ranging_show(avr_t *avr); // set the level of ECHO
bool ranging_listens(void); // INIT is high, or the HC-SR04 measures
void ranging_time_conversion(avr_t *avr); // call it after every instruction

/* turntable_model.c */
void turntable_start(avr_t *avr, double degrees);
void turntable_reset(avr_t *avr);
double turntable_degrees(void);
void turntable_slip(double microsteps);
void turntable_wedge(avr_t *avr, double seconds);
void turntable_show(avr_t *avr); // set the levels of the switches

/* servo_model.c */
void servo_start(avr_t *avr, double degrees);
double servo_degrees(void);

/* serial_line.c */
void line_start(avr_t *avr, const char *link, bool any_baud);
void line_reset(void);
void line_poll(avr_t *avr);
void line_end(void);
int line_terminal(void); // descriptor
double line_silence(const avr_t *avr); // s of board time since the last byte of a connected client
const char *line_name(void);

/* pace.c */
bool client_late(const avr_t *avr); // it has not read what the board has sent
void keep_pace(const avr_t *avr); // wait until real time reaches the board's time

/* parent.c */
void parent_start(int descriptor);
void parent_poll(avr_t *avr); // returns once the client is not late
void parent_request_echoes(avr_t *avr, const struct ping *ping, struct echoes *echoes);
void parent_report_ready(const char *url);

#endif
