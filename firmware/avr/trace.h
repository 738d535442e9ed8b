/* The trace of a ping. `traces/` samples it with the converter at 76.9 kS/s; `no-traces/` has none. */
#ifndef TRACE_H
#define TRACE_H

#include <stdint.h>

#include "hardware.h" // struct ping_result

void trace_prepare(uint32_t listen_us); // waits at most 0.1 ms for a conversion
void trace_go(void); // start sampling
void trace_stop(void);
uint32_t *trace_spare(void); // memory for ECHOES_MOST echoes, while no trace is taken
void trace_result(struct ping_result *result); // adds the samples

#endif
