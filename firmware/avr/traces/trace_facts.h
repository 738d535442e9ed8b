/* Constants of the trace: A0, sampled by the converter. */
#ifndef TRACE_FACTS_H
#define TRACE_FACTS_H

#ifndef TRACE_KIND
#define TRACE_KIND TRACE_KIND_ENVELOPE // signal on A0; TRACE_KIND_CARRIER for the amplifier's output
#endif
#define TRACE_FEATURES (TRACE_KIND == TRACE_KIND_CARRIER ? FEATURE_CARRIER : FEATURE_ENVELOPE)
#define TRACE_PERIOD_NS 13000 // 13 clocks of a converter at 1 MHz
#define TRACE_START_NS 2000 // from INIT to the first sample: 8 cycles, then 1.5 clocks of the converter
#define TRACE_RATE 76923
#define TRACE_SAMPLES 4800
#define LOST_MOST 32 // samples of a trace that can be marked as lost

#endif
