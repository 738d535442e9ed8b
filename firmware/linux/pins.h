/* Lines of the GPIO chip. On a Raspberry Pi, their numbers are those of its GPIO.
 *
 * ENABLE is one of GPIO 0 to 8, which have a pull-up after power on; the other outputs are among 9 to 27, with a pull-down.
 */
#ifndef PINS_H
#define PINS_H

// signal       GPIO     pin of the header
#define INIT 23 //       16
#define TRIGGER 23 //    16
#define BLNK 25 //       22
#define BINH 22 //       15
#define ECHO 24 //       18
#define STEP 17 //       11
#define DIRECTION 27 //  13; high is counter-clockwise
#define ENABLE 6 //      31; low lets current flow
#define HOME_MARK 20 //  38
#define HOME_SIDE 21 //  40
#define COIL_1 12 //     32
#define COIL_2 13 //     33
#define COIL_3 16 //     36
#define COIL_4 26 //     37

#endif
