/* The home switches, and the settings of the wiring that outlast a restart. */
#ifndef WIRING_H
#define WIRING_H

#include <stdbool.h>
#include <stdint.h>

void wiring_reset(void); // read what is stored
void wiring_set(uint8_t change, uint8_t wanted); // enum wiring; the wiring is no longer proven
uint8_t wiring_now(void); // enum wiring
void wiring_prove(bool proven); // whether a Home has succeeded with this wiring
bool wiring_proven(void);

bool one_switch(void); // there is only the mark, and its level shows the side of zero
bool motor_inverted(void);
bool marked_now(void); // counter-clockwise of zero by less than half a turn; also called by an interrupt
bool above_zero(void);

#endif
