/* Constants of a board with an AVR at 16 MHz. Its chip, ranging board, turntable and traces each have a file. */
#ifndef BOARD_FACTS_H
#define BOARD_FACTS_H

#include "chip_facts.h" // memory
#include "fields.h" // struct text
#include "ranging_facts.h" // the ranging board
#include "trace_facts.h" // the trace
#include "turntable_facts.h" // MICROSTEPS and others

#define ECHOES_MOST (ECHOES_DETECTED < ECHO_ROOM ? ECHOES_DETECTED : ECHO_ROOM) // of a reading
#define FASTEST_BAUD 1000000

struct text board_firmware(void);
struct text board_serial(void);
struct text board_profile(void);

#endif
