/* What a test does to the board of plain variables. */
#ifndef HOST_BOARD_H
#define HOST_BOARD_H

#include <stdbool.h>
#include <stdint.h>

enum host_motor { HOST_MOTOR_RAMPED, HOST_MOTOR_AT_ONCE, HOST_MOTOR_HELD, HOST_MOTOR_SLIPPING };

void host_start(void); // a board just switched on, at time 0
void host_identity(const char *firmware, const char *serial, const char *profile); // they must stay
void host_grain(uint32_t us); // how finely time passes
void host_temperature(int16_t centidegrees);
void host_stand(int32_t steps); // put the table there by hand
void host_motor(enum host_motor mode); // held: no step is made; slipping: steps are made, and the table stands still
// What every ping hears from now on: echoes in ticks, earliest first; the trace must stay.
void host_hear(const uint32_t *ticks, uint8_t count, const uint8_t *trace, uint16_t trace_size, uint32_t period_ns);

void host_send(const uint8_t *bytes, uint32_t size);
uint32_t host_receive(uint8_t *bytes, uint32_t most);
void host_advance(uint64_t until_us);

int32_t host_stands(void);
bool host_powered(void);
uint32_t host_baud(void);
uint32_t host_trespasses(void); // steps made and pieces sent while it listened

#endif
