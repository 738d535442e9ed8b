/* Serial number, count of starts and wiring, in the EEPROM. */
#ifndef IDENTITY_H
#define IDENTITY_H

#include <stdint.h>

void identity_start(void); // adds 1 to the count of starts

#endif
