/* What a ranging board in `ranging/` and a turntable in `turning/` provide besides the functions of `hardware.h`.
 *
 * There are no interrupts: the main loop calls `..._work` when an edge has come or a time is due.
 */
#ifndef PARTS_H
#define PARTS_H

#include <stdint.h>

#define NEVER UINT64_MAX

void ranging_start(void); // name its lines; call it before gpio_start
void ranging_work(void);
uint64_t ranging_due(void); // when `ranging_work` must be called, even without an edge; ns
void ranging_stop(void); // nothing transmits

void turning_start(void);
void turning_work(void);
uint64_t turning_due(void);

#endif
