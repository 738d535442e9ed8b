/* The analog converter: the trace of a ping at 76.9 kS/s, the thermistor when nobody listens. */
#ifndef CONVERTER_H
#define CONVERTER_H

#include <stdint.h>

void converter_start(void);
void converter_prepare(uint16_t count); // for so many samples of a trace: ends what it does, at most 0.1 ms
void converter_go(void); // sample from now on
void converter_stop(void);
uint8_t *converter_samples(void); // room for 4 800, anyone's between traces
uint16_t converter_count(void); // samples taken
void converter_work(void); // measures the temperature, a little at every call

#endif
