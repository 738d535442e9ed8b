/* The analog converter: samples the trace of a ping at 76.9 kS/s, and the thermistor between pings. */
#ifndef CONVERTER_H
#define CONVERTER_H

#include <stdint.h>

void converter_start(void);
void converter_prepare(uint16_t count); // for `count` samples of a trace; waits at most 0.1 ms for a conversion
void converter_go(void); // start sampling
void converter_stop(void);
uint8_t *converter_samples(void); // 4 800 bytes; free for other use between traces
uint16_t converter_count(void); // number of samples taken
uint8_t *const *converter_lost(void); // those that were not measured
uint8_t converter_lost_count(void);
void converter_work(void); // measures the temperature; one conversion per call

#endif
