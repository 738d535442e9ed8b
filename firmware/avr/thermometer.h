/* The thermistor on A1, measured between traces. */
#ifndef THERMOMETER_H
#define THERMOMETER_H

#include <stdint.h>

void thermometer_start(void);
void thermometer_pause(void); // for a trace; waits at most 0.1 ms for a conversion
void thermometer_resume(void);
void thermometer_work(void); // one conversion per call

#endif
