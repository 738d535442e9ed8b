/* Pins and timer of an ATmega328P. */
#ifndef PINS_H
#define PINS_H

#include "registers.h" // PIN_HIGH and others

// signal       port letter, bit      pin of an Arduino Uno or Nano
#define INIT D, 7 //                  7
#define TRIGGER D, 7 //               7
#define BLNK D, 6 //                  6
#define BINH D, 5 //                  5
#define STEP D, 2 //                  2
#define DIRECTION D, 3 //             3; high is counter-clockwise
#define ENABLE D, 4 //                4; low lets current flow
#define HOME_MARK B, 3 //             11
#define HOME_SIDE B, 4 //             12
#define COIL_1 B, 1 //                9
#define COIL_2 B, 2 //                10
#define COIL_3 B, 3 //                11
#define COIL_4 B, 4 //                12
#define SERVO B, 2 //                 10, compare output B of timer 1
#define ECHO B, 0 //                  8, the input capture of timer 1
// the thermistor is on A1

#define TIMER_NUMBER 1

#endif
