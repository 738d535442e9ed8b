/* Temperature in 0.01 °C, from 0 to full scale of the converter. */
#ifndef THERMISTOR_TABLE_H
#define THERMISTOR_TABLE_H

#include "flash.h" // FLASH

#define THERMISTOR_POINTS 33

extern FLASH const int16_t thermistor_table[THERMISTOR_POINTS];

#endif
