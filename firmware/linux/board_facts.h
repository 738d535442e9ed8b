/* Constants of a computer with Linux. It has no converter, and so neither traces nor a thermistor. */
#ifndef BOARD_FACTS_H
#define BOARD_FACTS_H

#include "fields.h" // struct text
#include "ranging_facts.h" // the ranging board
#include "trace_facts.h" // no traces
#include "turntable_facts.h" // MICROSTEPS and others

#define ECHOES_MOST ECHOES_DETECTED // of a reading
#define KEPT_STORE (64 * KEPT_SIZE(ECHOES_MOST)) // bytes: all readings that the protocol allows
#define FASTEST_BAUD 1000000 // a pseudo-terminal transmits as fast as the host reads

struct text board_firmware(void);
struct text board_serial(void);
struct text board_profile(void);

#endif
