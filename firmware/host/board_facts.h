/* Constants of the test board: the real turntable, and traces of 4 800 samples at most. */
#ifndef BOARD_FACTS_H
#define BOARD_FACTS_H

#include "fields.h" // struct text
#include "ranging_facts.h" // the 6500
#include "turntable_facts.h" // MICROSTEPS and others

extern uint32_t host_trace_period_ns;

#define TRACE_KIND TRACE_KIND_ENVELOPE
#define TRACE_PERIOD_NS host_trace_period_ns
#define TRACE_START_NS 0
#define TRACE_RATE 50000
#define TRACE_SAMPLES 4800
#define TRACE_FEATURES FEATURE_ENVELOPE
#define LOST_MOST 32
#define ECHOES_MOST 34
#define KEPT_STORE 616
#define FASTEST_BAUD 1000000

struct text board_firmware(void);
struct text board_serial(void);
struct text board_profile(void);

#endif
