/* Pins and timer of an ATmega2560. The ports of all outputs are below 0x20, where one instruction sets a pin. */
#ifndef PINS_H
#define PINS_H

#include "registers.h" // PIN_HIGH and others

// signal       port letter, bit      pin of an Arduino Mega 2560
#define INIT C, 0 //                  37
#define TRIGGER C, 0 //               37
#define BLNK C, 1 //                  36
#define BINH C, 2 //                  35
#define STEP A, 0 //                  22
#define DIRECTION A, 1 //             23; high is counter-clockwise
#define ENABLE A, 2 //                24; low lets current flow
#define HOME_MARK A, 3 //             25
#define HOME_SIDE A, 4 //             26
#define ECHO L, 0 //                  49, the input capture of timer 4
// the trace is on A0, the thermistor on A1

#define TIMER_NUMBER 4

#endif
