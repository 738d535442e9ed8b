/* Serial number, count of starts and wiring, in a small file instead of an EEPROM. */
#ifndef IDENTITY_H
#define IDENTITY_H

void identity_start(const char *file); // creates the file if it is missing; adds 1 to the count of starts

#endif
