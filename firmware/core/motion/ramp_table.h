/* How long step n from rest lasts, relative to step 0, of 65 535. */
#ifndef RAMP_TABLE_H
#define RAMP_TABLE_H

#include "flash.h" // FLASH

#define RAMP_STEPS 1024

extern FLASH const uint16_t ramp_table[RAMP_STEPS];

#endif
