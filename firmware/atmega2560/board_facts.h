/* Constants of an ATmega2560 at 16 MHz, as on the Arduino Mega 2560. Pins: pins.h and docs/how_to/firmware.md. */
#ifndef BOARD_FACTS_H
#define BOARD_FACTS_H

#include "fields.h" // struct text
#include "ranging_facts.h" // the 6500
#include "turntable_facts.h" // MICROSTEPS and others

#ifndef TRACE_KIND
#define TRACE_KIND TRACE_KIND_ENVELOPE // signal on A0; TRACE_KIND_CARRIER for the amplifier's output
#endif
#define TRACE_PERIOD_NS 13000 // 13 clocks of a converter at 1 MHz
#define TRACE_START_NS 2000 // from INIT to the first sample: 8 cycles, then 1.5 clocks of the converter
#define TRACE_RATE 76923
#define TRACE_SAMPLES 4800
#define FASTEST_BAUD 1000000

struct text board_firmware(void);
struct text board_serial(void);
struct text board_profile(void);

#endif
