/* Constants of a board that sends no traces. */
#ifndef TRACE_FACTS_H
#define TRACE_FACTS_H

#define TRACE_KIND TRACE_KIND_NONE
#define TRACE_FEATURES 0
#define TRACE_PERIOD_NS 0
#define TRACE_START_NS 0
#define TRACE_RATE 0
#define TRACE_SAMPLES 0
#define LOST_MOST 1

#endif
