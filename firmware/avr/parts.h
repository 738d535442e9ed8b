/* What a ranging board in `ranging/` and a turntable in `turning/` provide besides the functions of `hardware.h`. */
#ifndef PARTS_H
#define PARTS_H

void ranging_start(void); // set up its pins
void turning_start(void);

#endif
