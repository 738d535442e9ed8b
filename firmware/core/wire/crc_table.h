/* Constant tables; where they come from says generate.py. */
#ifndef TABLES_H
#define TABLES_H

#include "flash.h" // FLASH

#define RAMP_STEPS 1024
#define THERMISTOR_POINTS 33

extern FLASH const uint32_t crc_table[256]; // what one byte does to a reflected CRC-32
extern FLASH const uint16_t ramp_table[RAMP_STEPS]; // how long step n from rest lasts, relative to the first, of 65 535
extern FLASH const int16_t thermistor_table[THERMISTOR_POINTS]; // 0.01 °C, from 0 to full scale of the converter

#endif
