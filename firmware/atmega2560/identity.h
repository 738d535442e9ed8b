/* What the EEPROM knows: the serial number, and how often the board has started. */
#ifndef IDENTITY_H
#define IDENTITY_H

#include <stdint.h>

void identity_start(void); // counts a start

#endif
